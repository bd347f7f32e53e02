"""Scenes that contact problems are taken from."""
