"""Interior point methods with exact Coulomb friction: Newton's method inside cones, and along the central path."""
