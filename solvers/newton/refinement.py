"""Refinement on the identified states: the linear system that says open, closed, stick or slip as an iterate does.

An interior point method knows early which contacts are open, stick and slip, but its impulses keep an error of about
the square root of its tolerance, because they follow the central path. Once the states are right nothing but a linear
system is left of the problem, the projection equations of ``linearised`` (Alart & Curnier 1991; that a projection
identifies the states: Burke & Moré 1988). One Newton step solves it up to the curvature of slip, whose direction the
next steps correct. Where a step does not lower the judge's residual the states were not right, and the impulses stay
as they were.
"""

from collections.abc import Callable

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.contact.problem import ContactProblem
from ..iteration.clock import Clock
from .linear_solver import LinearSolver
from .linearised import Equations
from .steps import SEARCHING, THOROUGH, Attempt, newton_steps
from .work import Work

CLOSE = Attempt(damping=1e-12, most_steps=4, patience=1)
"""What is tried on identified states: each step has to lower the residual, and by half to be followed by another."""


class Refinement:
    """Newton steps from the iterates of another method, kept only where the judge's residual falls.

    Args:
        problem: the problem.
        residual: its residual.
        clock: the time that is left; no step is begun that would not end in it.
    """

    def __init__(self, problem: ContactProblem, residual: Residual, clock: Clock) -> None:
        self._problem, self._residual = problem, residual
        self._equations: Equations | None = None
        self._solver = LinearSolver(clock, Work(entries=0))

    def refined(self, impulses: FloatArray, residual: float, tolerance: float) -> tuple[FloatArray, float]:
        """Return better impulses [N s], shape (n_rows,), and their residual, or those given."""
        return self._tried((CLOSE,), impulses, residual, tolerance, lambda: True)

    def searched(
        self, impulses: FloatArray, residual: float, tolerance: float, goes_on: Callable[[], bool]
    ) -> tuple[FloatArray, float]:
        """As ``refined`` where states are not known to be right: more steps, and a search along them."""
        return self._tried((SEARCHING,), impulses, residual, tolerance, goes_on)

    def rescued(
        self, impulses: FloatArray, residual: float, tolerance: float, goes_on: Callable[[], bool]
    ) -> tuple[FloatArray, float]:
        """As ``searched`` with all that Newton's method has."""
        return self._tried(THOROUGH, impulses, residual, tolerance, goes_on)

    def _tried(
        self,
        attempts: tuple[Attempt, ...],
        impulses: FloatArray,
        residual: float,
        tolerance: float,
        goes_on: Callable[[], bool],
    ) -> tuple[FloatArray, float]:
        if self._equations is None:  # assembles G, which nobody has asked for if nothing is refined
            self._equations = Equations(self._problem, self._residual)
        best, lowest = impulses, residual
        for attempt in attempts:
            if lowest <= tolerance or not goes_on():
                break
            found, reached = newton_steps(
                self._equations, self._solver, self._judged, impulses, residual, attempt, tolerance, lambda _: goes_on()
            )
            if reached < lowest:
                best, lowest = found, reached
        return best, lowest

    def _judged(self, impulses: FloatArray) -> float:
        return self._residual(impulses, self._problem.relative_velocity(impulses))
