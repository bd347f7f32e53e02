"""Recordings of solver iterations and of simulations, as rerun files."""
