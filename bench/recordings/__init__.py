"""Recordings that one can watch: solvers as they iterate, and simulations as they run, as rerun files."""
