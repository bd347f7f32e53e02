"""Solvers of others, called as they are: their wheels are installed apart, with the extra ``peers``."""
