"""Contact problems as cone programs."""
