"""Plugins: what files and installed packages offer, and the problems and scenes among it."""
