"""Solvers made of solvers, and named so."""
