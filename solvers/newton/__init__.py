"""Newton's method on the projection equations, and methods built on it."""
