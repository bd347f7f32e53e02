"""Formulations as conic programs."""
