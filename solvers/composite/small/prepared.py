"""Robust on a small problem: one kernel call prepares the sweeps, and another runs them.

In ``Robust``, Python code runs between the kernels. On ten contacts, this code takes ten times as long as the kernels.
Here one kernel runs all sweeps and checks of an ordinary solve. Its operations and their order are those of ``Robust``.
Impulses, iterations and message are therefore the same. If the kernel stops early, for example because the residual
grows, ``Robust`` solves the problem from the start. The attempt takes less than a tenth of the time of ``Robust``.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ....problems.arrays import FloatArray, real_numbers
from ....problems.compilation.interpretation import DeferredKernels
from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Observer, Prepared, Solution, Status, Stop, check_stop
from ...iteration.stopping import MIN_PLATEAU_SWEEPS
from ..sweep_selection import SAFEGUARDED_SWEEPS, UNCOUPLED_SWEEPS
from .preparation import (
    COUPLED,
    UNSUITABLE,
    prepare_over_columns,
    prepare_over_factors,
    prepare_over_matrix,
    prepare_over_pieces,
)
from .sweeps import sweep_coupled, sweep_uncoupled

SWEEP_SECONDS_PER_NUMBER = 2.5e-9
"""Upper bound of the time of a sweep [s] per entry of G, where each row counts as 20 further entries. It is twice the
time on a slow core."""

MAX_SWEEPS = 10**9
"""Largest iteration limit that the kernel receives, as a 64-bit integer; larger limits are reduced to it."""

COUPLED_MESSAGE, UNCOUPLED_MESSAGE = (
    f"{sweeps.name}: {Status.SOLVED}" for sweeps in (SAFEGUARDED_SWEEPS, UNCOUPLED_SWEEPS)
)
"""Messages of solutions for coupled and for uncoupled contacts, as ``Robust`` reports them."""

SMALL_KERNELS = DeferredKernels(
    (
        prepare_over_matrix,
        prepare_over_columns,
        prepare_over_factors,
        prepare_over_pieces,
        sweep_coupled,
        sweep_uncoupled,
    ),
    uses_before_loading=300,
    uses_before_compiling=20_000,
)
"""The kernels of small problems, which take about 0.1 s to load and 10 to 25 s to compile."""


def longest_seconds(n_rows: int) -> float:
    """Return an upper bound of the kernel's time [s], for dense G and the largest number of sweeps.

    The kernel does not read the clock. It is not used if the time limit is shorter than this bound.
    """
    return MIN_PLATEAU_SWEEPS * SWEEP_SECONDS_PER_NUMBER * n_rows * (n_rows + 20)


class PreparedSmall:
    """The prepared sweeps of one small problem.

    Args:
        problem: the problem.
        is_coupled: whether its contacts are coupled.
        arguments: arguments of the kernel that depend on the problem.
        prepare_general: prepares ``Robust`` for problems of any size; called if the kernel does not solve the problem.
    """

    __slots__ = ("_arguments", "_general_prepared", "_kernel", "_message", "_prepare_general", "problem")

    def __init__(
        self,
        problem: ContactProblem,
        is_coupled: bool,
        arguments: tuple[Any, ...],
        prepare_general: Callable[[ContactProblem], Prepared],
    ) -> None:
        self.problem, self._arguments = problem, arguments
        self._kernel: Callable[..., tuple[bool, int]] = sweep_coupled if is_coupled else sweep_uncoupled
        self._message = COUPLED_MESSAGE if is_coupled else UNCOUPLED_MESSAGE
        self._prepare_general = prepare_general
        self._general_prepared: Prepared | None = None

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep in one kernel; if it stops early, solve with ``Robust``. See ``Prepared.solve``."""
        check_stop(stop)
        n_rows = len(self.problem.free_velocity)
        impulses = np.zeros(n_rows) if start is None else np.array(real_numbers(start, "start"), dtype=np.float64)
        has_time = stop.max_seconds >= longest_seconds(n_rows)
        if observe is None and has_time and impulses.shape == (n_rows,):
            limits = stop.tolerance, min(stop.max_iterations, MAX_SWEEPS)
            is_solved, iterations = self._kernel(*self._arguments, *limits, impulses)
            if is_solved:
                return Solution(impulses, Status.SOLVED, iterations, self._message)
        if self._general_prepared is None:
            self._general_prepared = self._prepare_general(self.problem)
        return self._general_prepared.solve(stop, start, observe)


def prepare_small(
    problem: ContactProblem, prepare_general: Callable[[ContactProblem], Prepared]
) -> PreparedSmall | None:
    """Return the prepared sweeps of a problem of at least one row, or None.

    None means that the problem has other laws or requires other sweeps. For ``prepare_general``, see ``PreparedSmall``.
    """
    laws = problem.laws
    arguments = laws.kind, laws.partner, laws.friction_coefficient, laws.fixed_bound, problem.free_velocity
    kernel, *matrix = _kernel_and_matrix(problem)
    coupling, scale, store = kernel(*arguments, *matrix)
    if coupling == UNSUITABLE:
        return None
    return PreparedSmall(problem, coupling == COUPLED, (*arguments, scale, store), prepare_general)


def _kernel_and_matrix(problem: ContactProblem) -> tuple[Any, ...]:
    """Return the kernel of ``preparation`` for a problem, and its arguments after c."""
    matrix, factors = problem.matrix, problem.factors
    if matrix is not None:
        return prepare_over_matrix, matrix.indptr, matrix.indices, matrix.data
    assert factors is not None
    columns, inverse_mass = factors.directions, factors.inverse_mass
    if isinstance(columns, Pieces):
        pieces = problem.factor_pieces()
        return prepare_over_pieces, pieces.starts, pieces.chunks, pieces.values, pieces.n_chunks
    entries = columns.indptr, columns.indices, columns.data
    if inverse_mass.is_diagonal:
        return prepare_over_columns, *entries, inverse_mass.root_diagonal
    root = inverse_mass.root
    return prepare_over_factors, *entries, root.indptr, root.indices, root.data
