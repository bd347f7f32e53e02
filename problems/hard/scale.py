"""What the hard cases share: weight and time step."""

GRAVITY = 9.81
"""[m/s²]"""

TIME_STEP = 1e-3
"""[s]"""

WEIGHT = GRAVITY * TIME_STEP
"""Impulse that bears one kilogramme for one step [N s], and the free velocity of whatever falls for one step [m/s]."""
