"""Projected iterations, one method a file: those of Studer & Glocker 2005, section 4, and splittings to compare."""
