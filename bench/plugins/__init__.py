"""Solvers, problems and scenes of plugins: described as data, created and run in child processes."""
