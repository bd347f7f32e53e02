"""Robust on small problems of contacts alone: one kernel prepares the sweeps, and one does them."""
