"""Contact problems as linear complementarity problems."""
