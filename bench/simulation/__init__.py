"""Simulations: take the steps of a scene, judge, store and show them."""
