"""How results are shown: tables, charts, progress, and the files that they are written to."""
