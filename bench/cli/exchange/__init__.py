"""Commands that read and write files of other people: bundles of runs, and problems in FCLIB form."""
