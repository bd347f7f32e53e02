"""Runs as single files: pack, read, judge again and merge them."""
