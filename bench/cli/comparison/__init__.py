"""Commands that compare solvers or runs."""
