"""Detection of contacts between bodies."""
