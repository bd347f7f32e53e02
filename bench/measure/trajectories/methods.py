"""Specifications of steppers with solvers; each yields a curve over a ladder of the stepper or the solver.

``Extrapolated(search='nested') with SORprox``   the tolerance of the stepper varies, or its step [s] if it is fixed
``SORprox in Moreau(step=0.001)``                the tolerance of the solver varies
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from msgspec import structs

from ....problems.motion.stepping.moreau import Moreau
from ....problems.motion.stepping.registry import EXAMPLE, STEPPERS, make_stepper
from ....problems.motion.stepping.stepper import Stepper
from ....problems.motion.stepping.variable_stepper import VariableStepper
from ....problems.names import read_name
from ...errors import BenchError
from ...plugins.descriptions import solver_spec
from ...plugins.solver_specs import SolverSpec
from ...simulation.starts import DEFAULT_START, check_start, default_start
from ...store.plans import MethodRecord

WITH, IN = " with ", " in "
"""Words between the stepper and the solver in the name of a method: the first one varies."""

RESOLUTION = 100.0
"""Ratio of the tolerance of a variable stepper to its default minimal step in seconds."""

ITERATIONS = 20_000
"""Iteration limit of each one-step solve."""


@dataclass(frozen=True)
class Method:
    """The specification of a stepper with a solver.

    Attributes:
        record: its name, ladder and limits.
        stepper: the stepper with its options.
        solver: the solver.
    """

    record: MethodRecord
    stepper: str
    solver: SolverSpec

    def with_start(self, start: str) -> "Method":
        """Return the method with another start; a stepper that does not use initial impulses starts cold.

        Raises:
            BenchError: for an unknown start; the message suggests the nearest name.
        """
        check_start(start)
        stepper = make_stepper(self.stepper)
        if not stepper.uses_last_impulses:
            start = default_start(stepper)
        return replace(self, record=structs.replace(self.record, start=start))

    def setting(self, value: float) -> tuple[Stepper, float]:
        """Return the stepper and the tolerance of the solver at a value of the ladder."""
        stepper = make_stepper(self.stepper)
        untyped: Any = stepper  # not every stepper has a tolerance
        if self.record.name == solver_method_name(self.solver, self.stepper):
            return stepper, value
        if isinstance(stepper, Moreau):
            return replace(stepper, step=value), self.record.tolerance
        has_resolution = isinstance(stepper, VariableStepper) and "min_step" not in self.stepper
        min_step = {"min_step": value / RESOLUTION} if has_resolution else {}
        return replace(untyped, tolerance=value, **min_step), self.record.tolerance


def solver_method_name(solver: SolverSpec, stepper: str) -> str:
    """Return the name of the method in which the tolerance of the solver varies."""
    return f"{solver.name}{IN}{stepper}"


def make_method(
    name: str,
    values: Sequence[float],
    tolerance: float = 1e-12,
    max_iterations: int = ITERATIONS,
    specification: SolverSpec | None = None,
    *,
    start: str = DEFAULT_START,
) -> Method:
    """Return the method that a name describes.

    Args:
        name: ``STEPPER with SOLVER`` or ``SOLVER in STEPPER``.
        values: the ladder, in any order.
        tolerance: tolerance of the solver if the stepper varies.
        max_iterations: iteration limit of each one-step solve.
        specification: specification of the solver; created from ``name`` if None.
        start: name of the start of each solve.

    Raises:
        BenchError: if ``name`` is not a method, or a value is out of range.
        ProxbenchError: for an unknown stepper, solver or option; the message suggests the nearest name.
    """
    stepper, separator, solver = name.partition(WITH)
    varies_solver = not separator or stepper.partition("(")[0].strip() not in STEPPERS
    if varies_solver:
        solver, separator, stepper = name.rpartition(IN)
    if not separator:
        raise BenchError(
            f"cannot read {name!r:.200} as a method; write a stepper with a solver, {EXAMPLE} with SORprox, or a "
            f"solver in a stepper, SORprox in {EXAMPLE}."
        )
    ladder = sorted(set(map(float, values)), reverse=True)
    invalid = next((value for value in (*ladder, tolerance) if not 0.0 < value < 1.0), None)
    if invalid is not None or not ladder:
        raise BenchError(f"the ladder of {name!r:.200} needs values between 0 and 1, got {invalid or 'none'}.")
    make_stepper(stepper)
    spec = specification or solver_spec(solver.strip())
    stepper = str(read_name(stepper, "stepper", EXAMPLE, BenchError))
    full_name = solver_method_name(spec, stepper) if varies_solver else f"{stepper}{WITH}{spec.name}"
    record = MethodRecord(
        name=full_name, values=ladder, tolerance=tolerance, max_iterations=max_iterations, start=start
    )
    return Method(record, stepper, spec).with_start(start)


def stored_method(record: MethodRecord) -> Method:
    """Return a method of a stored run; errors as in ``make_method``."""
    return make_method(record.name, record.values, record.tolerance, record.max_iterations, start=record.start)


def scaled_stepper(stepper: Stepper, factor: float, duration: float) -> Stepper:
    """Return a stepper with ``factor`` times its tolerance, or times the number of steps in ``duration`` [s].

    The number of steps is rounded, so that the last one ends exactly at ``duration``.
    """
    untyped: Any = stepper  # not every stepper has a step or a tolerance
    if isinstance(stepper, Moreau):
        return replace(untyped, step=duration / max(1, round(duration / untyped.step * factor)))  # type: ignore[no-any-return]
    return replace(untyped, tolerance=untyped.tolerance * factor)  # type: ignore[no-any-return]
