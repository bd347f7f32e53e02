"""Scenes of rigid bodies with faces."""
