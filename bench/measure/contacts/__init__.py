"""One solver on one contact problem: making the problem, the case, its process, and what its times are compared with."""
