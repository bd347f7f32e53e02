"""The solver interface: options, statuses and results.

``Solver.prepare`` does the work that depends on the problem alone (assemble, factorise, compile), and is timed
separately. ``Prepared.solve`` iterates until the judge's residual reaches the tolerance, or reports why it does not.
"""

import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from numbers import Real
from typing import Protocol, runtime_checkable

import numpy as np

from ..arrays import FloatArray, real_vector
from ..errors import ProblemError, ProxbenchError
from ..representation import counted, html_table
from .model import Model
from .problem import ContactProblem

Observer = Callable[[int, FloatArray], None]
"""``observe(iteration, impulses)`` is called once per iteration with a read-only view of Λ over rows."""


class SolverError(ProxbenchError, ValueError):
    """A solver or one of its options does not exist or is not valid."""


class Status(StrEnum):
    """How a solve ended."""

    SOLVED = "solved"
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    STALLED = "stalled"
    OSCILLATING = "oscillating"
    DIVERGED = "diverged"
    INFEASIBLE = "infeasible"
    UNSUPPORTED = "unsupported"

    @property
    def sentence(self) -> str:
        """The meaning of the status, as a sentence."""
        return _SENTENCES[self]


_SENTENCES = {
    Status.SOLVED: "The residual reached the tolerance.",
    Status.ITERATION_LIMIT: "The solver reached the iteration limit before the tolerance.",
    Status.TIME_LIMIT: "The solver reached the time limit before the tolerance.",
    Status.STALLED: "Further iterations cannot reduce the residual.",
    Status.OSCILLATING: "The iterates repeat in a cycle.",
    Status.DIVERGED: "The iterates grow without bound.",
    Status.INFEASIBLE: "The problem has no solution.",
    Status.UNSUPPORTED: "The solver does not support this problem.",
}


@dataclass(frozen=True)
class Stop:
    """Stopping criteria of a solve.

    A constant residual does not end a solve, because it may still fall after a million sweeps. A solve that neither
    reaches the tolerance nor fails therefore ends at the first of two limits. If both are infinite, it may never end.

    Attributes:
        tolerance: the judge's residual to reach, dimensionless, positive. It is stored as a float.
        max_iterations: largest number of iterations, a whole number or infinity. It is stored as an integer, infinity
            as ``sys.maxsize``.
        max_seconds: largest wall time [s], without preparation and without the compilation of kernels. It is stored as
            a float.

    Raises:
        SolverError: if ``max_iterations`` is negative or has a fractional part, another attribute is not positive, or
            one is not a number.
    """

    tolerance: float = 1e-6
    max_iterations: int = 10_000
    max_seconds: float = 60.0

    def __post_init__(self) -> None:
        values: tuple[object, ...] = (self.tolerance, self.max_iterations, self.max_seconds)
        if not all(isinstance(value, Real) for value in values):
            shown = "{!r}, {!r} and {!r}".format(*values)
            raise SolverError(f"`tolerance`, `max_iterations` and `max_seconds` must be numbers, got {shown}.")
        for name in ("tolerance", "max_seconds"):  # a kernel would be compiled again for each type of number
            object.__setattr__(self, name, _nearest_float(getattr(self, name)))
        if not self.tolerance > 0:
            raise SolverError(f"`tolerance` must be positive, got {self.tolerance:g}; choose one such as 1e-6.")
        if not self.max_iterations >= 0:
            raise SolverError(
                f"`max_iterations` must not be negative, got {self.max_iterations}; choose one such as 1000."
            )
        limit = sys.maxsize if self.max_iterations >= sys.maxsize else int(self.max_iterations)
        if limit < self.max_iterations < sys.maxsize:
            raise SolverError(f"`max_iterations` must be a whole number, got {self.max_iterations}.")
        object.__setattr__(self, "max_iterations", limit)
        if not self.max_seconds > 0:
            raise SolverError(f"`max_seconds` must be positive, got {self.max_seconds:g}; choose one such as 60.")


def _nearest_float(number: float) -> float:
    """Return a real number of any type as a float, infinite if it is too large."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def check_limit_names(function: str, limits: Iterable[str]) -> None:
    """Raise ``SolverError`` if a limit passed to ``function`` is not an attribute of ``Stop``."""
    for name in limits:
        if name not in ("max_iterations", "max_seconds"):
            start = "; to start from impulses, call create(solver).prepare(problem).solve(stop, start)"
            raise SolverError(
                f"{function} has no argument `{name}`; it takes max_iterations and max_seconds"
                f"{start if name == 'start' else ''}."
            )


def check_stop(stop: object) -> None:
    """Raise ``SolverError`` unless the first argument of ``Prepared.solve`` is a ``Stop``."""
    if not isinstance(stop, Stop):
        raise SolverError(f"solve takes a Stop, such as Stop(1e-6), not a value of type {type(stop).__name__}.")


def start_impulses(start: FloatArray | None, n_rows: int) -> FloatArray:
    """Return the second argument of ``Prepared.solve`` as a fresh array, shape (n_rows,); zeros for None.

    Raises:
        ProblemError: if ``start`` has the wrong shape, or is not made of finite real numbers.
    """
    if start is None:
        return np.zeros(n_rows)
    impulses = real_vector(start, "start", n_rows).copy()
    if not np.isfinite(impulses).all():
        row = int(np.flatnonzero(~np.isfinite(impulses))[0])
        raise ProblemError(f"start[{row}] = {impulses[row]} must be finite; omit start to begin from zero.")
    return impulses


@dataclass(frozen=True, eq=False)
class Solution:
    """The result of a solve: the best finite iterate, and how the solve ended.

    Attributes:
        impulses: Λ [N s], shape (n_rows,).
        status: how the solve ended.
        iterations: number of iterations.
        message: the reason for the status; may be empty.
    """

    impulses: FloatArray
    status: Status
    iterations: int
    message: str = ""

    def __repr__(self) -> str:
        counts = f"{counted(len(self.impulses), 'row')}, {counted(self.iterations, 'iteration')}"
        return f"<Solution {self.status}: {counts}{self.message and f'; {self.message}'}>"

    def _repr_html_(self) -> str:
        largest = float(np.abs(self.impulses).max(initial=0.0))
        facts = {"rows": len(self.impulses), "iterations": self.iterations, "largest impulse [N s]": largest}
        return html_table(f"Solution: {self.status}", {**facts, **({"message": self.message} if self.message else {})})


class Prepared(Protocol):
    """A solver prepared for one problem.

    A solver that works asynchronously, for example on a GPU, also has a method ``synchronise()``. It waits until the
    impulses are in the array of the solution, and is called before the clock stops. If the prepared solver uses fewer
    threads than the solver declares, its ``threads`` is their number.
    """

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve from ``start`` (zeros if None), calling ``observe`` once per iteration if given."""
        ...


@runtime_checkable
class Solver(Protocol):
    """A method with its options.

    A plugin may omit ``has_iterates``; True is then assumed (see ``shows_iterates``). A solver that uses random numbers
    sets ``is_randomised = True``; for any other solver, results that differ between repeats are reported. A solver that
    computes in several threads declares their number in ``threads``, and measurements give it as many cores; any other
    solver is measured on one core.
    """

    @property
    def has_iterates(self) -> bool:
        """Whether ``observe`` is called; False for a solver without meaningful inner iterates."""
        ...

    @property
    def name(self) -> str:
        """Unique name, with the options that differ from the defaults: ``"SORprox(relaxation=1.5)"``."""
        ...

    @property
    def model(self) -> Model:
        """The model that is solved, not necessarily Coulomb friction."""
        ...

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None if it can."""
        ...

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Do the work that depends on the problem alone, and return the solver prepared for ``problem``."""
        ...


def shows_iterates(solver: Solver) -> bool:
    """Return whether ``solver`` calls its observer once per iteration."""
    return bool(getattr(solver, "has_iterates", True))


def threads_of(solver: Solver) -> int:
    """Return the number of threads that ``solver`` declares; 1 by default."""
    return int(getattr(solver, "threads", 1))


def draws_randomly(solver: Solver) -> bool:
    """Return whether ``solver`` declares that its results differ between repeats."""
    return bool(getattr(solver, "is_randomised", False))


def starts_from_last_answer(solver: Solver) -> bool:
    """Return whether a run starts ``solver`` from its solution of the previous step, as ``Warm`` declares."""
    return bool(getattr(solver, "starts_warm", False))
