"""Simulations with a variable step: every accepted step and every switching point, stored, tabled and drawn."""
