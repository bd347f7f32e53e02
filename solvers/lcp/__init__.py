"""Contact problems as complementarity problems."""
