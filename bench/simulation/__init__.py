"""Whole simulations: a scene, a stepper and a solver, step by step, judged, stored and shown."""
