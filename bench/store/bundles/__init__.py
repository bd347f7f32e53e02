"""Runs that travel as one file: packed, read from strangers, judged again, merged."""
