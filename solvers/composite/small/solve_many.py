"""Many small problems in one call, on several threads.

The arrays of all small problems are joined, and each thread runs one kernel over a range of them, without Python. No
problem affects another, so solutions are bitwise identical for any number of threads.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....problems.arrays import FloatArray, IntArray
from ....problems.contact.judge import judge
from ....problems.contact.laws import Laws
from ....problems.contact.matrices.memory import require_memory
from ....problems.contact.matrices.pieces import Pieces
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import Solution, SolverError, Status, Stop, check_limit_names
from ....problems.exchange.catalog import load
from ...iteration.cores import thread_requirement, usable_cores
from ..robust import Robust
from ..sweep_selection import MAX_SMALL_ROWS
from .batch import NOT_SOLVED, solve_over_factors, solve_over_matrices
from .preparation import COUPLED
from .prepared import COUPLED_MESSAGE, MAX_SWEEPS, UNCOUPLED_MESSAGE, longest_seconds

LAW_ARRAYS = ("kind", "partner", "friction_coefficient", "fixed_bound")
"""Arrays of ``Laws`` that determine the laws."""

PARTS_PER_THREAD = 4
"""Number of ranges of problems per thread; several, because some ranges take longer than others."""


class SolvedProblems(NamedTuple):
    """The solutions of many problems.

    Attributes:
        solutions: one for each problem, in their order.
        residuals: the judge's residual of each, shape (n_problems,).
    """

    solutions: list[Solution]
    residuals: FloatArray


def solve_many(
    problems: Iterable[ContactProblem | str | Path], tolerance: float = 1e-6, *, threads: int = 1, **limits: Any
) -> SolvedProblems:
    """Solve many problems with ``Robust``, with the same results as separate solves, and judge each solution.

    Problems of up to 150 rows, given by G or by the columns of W, are solved in batches. Other problems, and those that
    sweeps alone do not solve, are solved one by one in one thread.

    Args:
        problems: the contact problems, their names, or the paths of their files.
        tolerance: the judge's residual to reach.
        threads: number of threads; solutions are bitwise identical for any number.
        limits: ``max_iterations`` and ``max_seconds`` per problem.

    Returns:
        The solutions in the order of the problems, and the judge's residuals, shape (n_problems,).

    Raises:
        ProblemError: if a problem cannot be loaded.
        SolverError: if an element is not a problem, an option is out of range, or there are more threads than cores.
        InsufficientMemoryError: if the available memory does not suffice for joined copies of the problems.
    """
    check_limit_names("solve_many", limits)
    solver, stop = Robust(), Stop(tolerance, **limits)
    _check_threads(threads)
    if isinstance(problems, ContactProblem | str | Path) or not isinstance(problems, Iterable):
        raise SolverError("problems must be a list of problems; for one problem, use solve.")
    loaded = [load(problem) if isinstance(problem, str | Path) else problem for problem in problems]
    for index, problem in enumerate(loaded):
        _check_problem(index, problem)
    by_sweeps: list[Solution | None] = [None] * len(loaded)
    residuals = np.full(len(loaded), np.inf)
    for batch in _batches(loaded, stop.max_seconds):
        for index, solution, residual in batch.solve(stop, threads):
            by_sweeps[index], residuals[index] = solution, residual
    solutions = [
        _solve_one(solver, problem, stop) if solution is None else solution
        for solution, problem in zip(by_sweeps, loaded, strict=True)
    ]
    for index in np.flatnonzero(~np.isfinite(residuals)).tolist():
        residuals[index] = judge(loaded[index], solutions[index].impulses).residual
    return SolvedProblems(solutions, residuals)


def _solve_one(solver: Robust, problem: ContactProblem, stop: Stop) -> Solution:
    reason = solver.supports(problem)
    if reason is not None:
        return Solution(np.zeros(problem.n_rows), Status.UNSUPPORTED, 0, reason)
    return solver.prepare(problem).solve(stop)


def _check_problem(index: int, problem: object) -> None:
    if not isinstance(problem, ContactProblem):
        kind = type(problem).__name__
        raise SolverError(f"problems[{index}] must be a ContactProblem, a name or a path, not {kind}.")


def _check_threads(threads: int) -> None:
    n_cores = usable_cores()
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= n_cores:
        raise SolverError(f"threads must be {thread_requirement(n_cores)}, got {threads!r}.")


class Batch(NamedTuple):
    """Small problems that are given in the same form.

    Attributes:
        kernel: the function of ``batch`` for this form.
        indices: the index of each problem among all problems.
        rows: the first row of each problem, then the total number of rows.
        arguments: the arguments of the kernel between the range of problems and the tolerance.
    """

    kernel: Callable[..., None]
    indices: list[int]
    rows: list[int]
    arguments: tuple[Any, ...]

    def solve(self, stop: Stop, threads: int) -> Iterator[tuple[int, Solution, float]]:
        """Yield the index, solution and residual of each problem that sweeps solve."""
        n_problems = len(self.indices)
        impulses, residuals = np.empty(self.rows[-1]), np.empty(n_problems)
        outcomes, iterations = np.empty((2, n_problems), dtype=np.int64)
        limits = stop.tolerance, min(stop.max_iterations, MAX_SWEEPS)

        def solve_range(bounds: tuple[int, int]) -> None:
            self.kernel(*bounds, *self.arguments, *limits, impulses, outcomes, iterations, residuals)

        if threads == 1:
            solve_range((0, n_problems))
        else:
            n_parts = min(n_problems, PARTS_PER_THREAD * threads)
            parts = np.linspace(0, n_problems, n_parts + 1).astype(int).tolist()
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(solve_range, pairwise(parts)))
        results = zip(self.indices, outcomes.tolist(), iterations.tolist(), residuals.tolist(), strict=True)
        for (index, outcome, count, residual), (begin, end) in zip(results, pairwise(self.rows), strict=True):
            if outcome != NOT_SOLVED:
                message = COUPLED_MESSAGE if outcome == COUPLED else UNCOUPLED_MESSAGE
                yield index, Solution(impulses[begin:end].copy(), Status.SOLVED, count, message), residual


def _batches(problems: Sequence[ContactProblem], max_seconds: float) -> Iterator[Batch]:
    """Yield a batch of problems given by G and one of those given by the columns of W, unless they are empty.

    They contain the small problems whose sweeps end within ``max_seconds`` [s].
    """
    over_matrices, over_factors = _Members(), _Members()
    for index, problem in enumerate(problems):
        is_small = 0 < problem.n_rows <= MAX_SMALL_ROWS and longest_seconds(problem.n_rows) <= max_seconds
        if not is_small:
            continue
        if problem.matrix is not None:
            over_matrices.add(index, problem)
        elif problem.factors is not None and not isinstance(problem.factors.directions, Pieces):
            over_factors.add(index, problem)
    matrices: list[Any] = [problem.matrix for problem in over_matrices.problems]
    factors: list[Any] = [problem.factors for problem in over_factors.problems]
    directions, inverse_masses = [pair.directions for pair in factors], [pair.inverse_mass for pair in factors]
    inverses, roots = [inverse.matrix for inverse in inverse_masses], [inverse.root for inverse in inverse_masses]
    joined = [*over_matrices.problems, *over_factors.problems]
    _require_memory(joined, [*matrices, *directions, *inverses, *roots])
    if matrices:
        yield over_matrices.batch(solve_over_matrices, matrices, ())
    if factors:
        dofs = np.array([0, *accumulate(inverse.shape[0] for inverse in inverses)])
        is_diagonal = np.array([inverse.is_diagonal for inverse in inverse_masses])
        mass = (_first_entries(inverses), *_joined_matrices(inverses), is_diagonal)
        extra = (dofs, *mass, _first_entries(roots), *_joined_matrices(roots))
        yield over_factors.batch(solve_over_factors, directions, extra)


def _require_memory(problems: Sequence[ContactProblem], matrices: Sequence[Any]) -> None:
    """Raise ``InsufficientMemoryError`` if the available memory does not suffice for joined copies of all batches."""
    matrix_bytes = sum(matrix.data.nbytes + matrix.indices.nbytes + matrix.indptr.nbytes for matrix in matrices)
    vector_bytes = 3 * sum(problem.free_velocity.nbytes for problem in problems)  # c, Λ, and Λ in the solutions
    purpose = f"solving {len(problems):,} problems in one call"
    require_memory(matrix_bytes + vector_bytes, purpose, "solve them in several calls")


class _Members:
    """The small problems of one batch, and their distinct laws."""

    def __init__(self) -> None:
        self.indices: list[int] = []
        self.problems: list[ContactProblem] = []
        self._laws: list[Laws] = []
        self._law_of_problem: list[int] = []
        self._law_numbers: dict[int, int] = {}

    def add(self, index: int, problem: ContactProblem) -> None:
        """Add a problem with its index among all problems."""
        number = self._law_numbers.setdefault(id(problem.laws), len(self._laws))
        if number == len(self._laws):
            self._laws.append(problem.laws)
        self.indices.append(index)
        self.problems.append(problem)
        self._law_of_problem.append(number)

    def batch(self, kernel: Callable[..., None], matrices: list[Any], extra: tuple[Any, ...]) -> Batch:
        """Return the batch; ``matrices`` give the problems, and the kernel takes the ``extra`` arguments after them."""
        rows = [0, *accumulate(problem.n_rows for problem in self.problems)]
        free_velocity = _joined([problem.free_velocity for problem in self.problems])
        joined = self._joined_laws(), np.array(self._law_of_problem), np.array(rows), _first_entries(matrices)
        return Batch(kernel, self.indices, rows, (*joined, *_joined_matrices(matrices), *extra, free_velocity))

    def _joined_laws(self) -> tuple[Any, ...]:
        """Return the laws in the form that the kernels of ``batch`` take."""
        starts = np.array([0, *accumulate(len(laws.kind) for laws in self._laws)])
        arrays = ([getattr(laws, name) for laws in self._laws] for name in LAW_ARRAYS)
        return (starts, *map(_joined, arrays))


def _joined(arrays: Sequence[Any]) -> Any:
    """Return the concatenated arrays, read-only if the first one is."""
    joined_array = np.concatenate(arrays)
    joined_array.setflags(write=arrays[0].flags.writeable)
    return joined_array


def _first_entries(matrices: list[Any]) -> IntArray:
    """Return the first entry of each matrix among those of all, then the total number of entries."""
    return np.array([0, *accumulate(len(matrix.data) for matrix in matrices)])


def _joined_matrices(matrices: list[Any]) -> tuple[Any, Any, Any]:
    """Return the concatenated starts, indices and entries of compressed matrices."""
    return tuple(_joined([getattr(matrix, name) for matrix in matrices]) for name in ("indptr", "indices", "data"))
