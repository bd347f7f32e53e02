"""A fixed part of the table of all solvers and checks or cases: an eighth, in which each of them occurs."""

STRIDE = 8


def is_on_diagonal(row: int, column: int) -> bool:
    """Return whether an entry of a table is on one of the diagonals that contain every eighth entry of each row."""
    return (row + column) % STRIDE == 0
