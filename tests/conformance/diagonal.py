"""A fixed part of the table of all solvers and checks or cases, in which each of them occurs."""

STRIDE = 8
"""Distance of the diagonals: an eighth of the table is on them."""


def is_on_diagonal(row: int, column: int, stride: int = STRIDE) -> bool:
    """Return whether an entry of a table is on one of the diagonals that contain every ``stride``-th entry of a row."""
    return (row + column) % stride == 0
