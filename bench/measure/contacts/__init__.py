"""Measure one solver on one contact problem: the case, its process, and control solves."""
