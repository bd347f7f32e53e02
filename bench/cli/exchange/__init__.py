"""Commands that exchange files: bundles of runs, and problem files in other formats."""
