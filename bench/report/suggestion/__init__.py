"""Which solver to take for a problem: from what was measured on problems like it."""
