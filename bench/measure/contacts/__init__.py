"""One solver on one contact problem: problem, case, process, and what its times are compared with."""
