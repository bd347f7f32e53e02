"""What moves: bodies, what touches what, time steps, scenes and trajectories."""
