"""Robust on small problems of contacts alone: one kernel prepares, one kernel solves."""
