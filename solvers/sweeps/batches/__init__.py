"""Sweeps over contacts in batches that the vector units of the processor update simultaneously."""
