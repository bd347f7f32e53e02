"""Measures of whole motions: the error of a limit cycle, the flow of a pour, the distance from a known end."""
