"""The linear systems of interior points, over contacts or over bodies, and the factorisation of their blocks."""
