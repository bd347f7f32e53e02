"""Commands that set solvers, or runs, side by side."""
