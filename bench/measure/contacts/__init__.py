"""Measure one solver on one contact problem: problem, case, process, and control solves."""
