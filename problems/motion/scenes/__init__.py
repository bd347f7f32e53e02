"""Scenes to simulate, from which contact problems are taken."""
