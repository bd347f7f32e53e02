"""Measuring: what a run plans, and how each case is measured and judged."""
