"""Executors of runs: in this process, or on the workers of an executor."""
