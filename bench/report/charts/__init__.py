"""Charts of runs: one of each problem, those of the whole run, and how all are drawn and written."""
