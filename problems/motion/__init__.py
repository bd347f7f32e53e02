"""Moving bodies: contact detection, time stepping, scenes and trajectories."""
