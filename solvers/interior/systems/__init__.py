"""Linear systems of interior point methods, over contacts or over bodies, and their block factorisation."""
