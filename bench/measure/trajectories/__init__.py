"""Measuring on trajectories: steppers with solvers, whole simulations of a scene, and the error of their ends."""
