"""Recorders that draw the bodies of scenes: balls, rigid bodies and the woodpecker, with their meshes."""
