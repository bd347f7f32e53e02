"""Algebraic cases with known answers: redundant, degenerate, ill-conditioned, ambiguous and impossible contacts.

Every case is one contact problem in Delassus or factor form with its ``Answer``, which contains only unique quantities.
Δt = 1e-3 s and g = 9.81 m/s² throughout.
"""

from .bodies import GRAVITY, TIME_STEP
from .cases import CASE_GROUPS, HARD_CASES, hard_case
from .stacks import stack

__all__ = ["CASE_GROUPS", "GRAVITY", "HARD_CASES", "TIME_STEP", "hard_case", "stack"]
