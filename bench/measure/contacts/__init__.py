"""One solver on one contact problem: the case, what happens in its process, and what its times are held against."""
