"""Solvers that combine other solvers, and are named accordingly."""
