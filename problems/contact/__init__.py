"""The contact problem: its force laws, its matrices, and the judge of its answers."""
