"""Charts of runs: charts of problems and of the whole run, and their layout and files."""
