"""Starts by name."""

from ....problems.contact.solver import Solver
from ....problems.errors import suggestion
from ....problems.motion.stepping.stepper import Stepper
from ...errors import BenchError
from .cold import Cold
from .step_solver import StepSolver
from .warm import Warm
from .warm_then_cold import WarmThenCold

STARTS: dict[str, type[StepSolver]] = {kind.name: kind for kind in (Warm, Cold, WarmThenCold)}
"""The classes by their names."""


DEFAULT_START = Warm.name
"""The start unless one is named: it takes the fewest sweeps on most scenes and tolerances."""


def default_start(stepper: Stepper) -> str:
    """Return the start unless one is named; a stepper that offers no impulses starts cold."""
    return DEFAULT_START if stepper.uses_last_impulses else Cold.name


def check_start(name: str) -> None:
    """Check that a start has this name.

    Raises:
        BenchError: if none has, with the nearest name.
    """
    if name not in STARTS:
        raise BenchError(f"there is no start {name!r}{suggestion(name, STARTS)}")


def make_step_solver(start: str, solver: Solver) -> StepSolver:
    """Return ``solver`` with the start of this name; errors as in ``check_start``."""
    check_start(start)
    return STARTS[start](solver)
