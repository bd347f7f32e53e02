"""One accepted step, whatever stepper took it: where it led, the one-step solves behind it, and what it cost."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..state import State
from .contact_states import LawStates, SwitchingPoint
from .moreau import Step


@dataclass(frozen=True, eq=False)
class AcceptedStep:
    """One accepted step.

    Attributes:
        begin: the state at its begin.
        end: the state at its end.
        substeps: the one-step solves that led from one to the other, each with its length [s].
        error: estimated relative error; 0 where none is estimated.
        states: states of the laws in its last one-step solve; empty for a stepper that does not look at them.
        switches: switching points in it.
        solves: one-step inclusions solved for it, those of rejected attempts included.
        rejected: attempts rejected before it.
        seconds: wall time of all its attempts [s].
    """

    begin: State
    end: State
    substeps: Sequence[tuple[Step, float]]
    error: float = 0.0
    states: LawStates = LawStates()  # noqa: RUF009 - frozen
    switches: Sequence[SwitchingPoint] = ()
    solves: int = 1
    rejected: int = 0
    seconds: float = 0.0
