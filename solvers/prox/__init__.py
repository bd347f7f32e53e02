"""Projected iterations: the methods of Studer & Glocker (2005, section 4), accelerations, and splitting methods."""
