"""How results are shown: tables, charts, and the files that they are written to."""
