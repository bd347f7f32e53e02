"""Comparison of two runs: solvers that became faster or slower, and problems that became solved or unsolved."""
