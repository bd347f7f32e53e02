"""Newton's method on the projection equations."""
