"""Rigid bodies with faces: shapes, orientations, and the system that steppers move."""
