"""``proxbench matrix``: solve every problem with every solver once, and give the reason for each failure.

The matrix shows whether a method can solve a problem, not how fast. Each cell is one untimed solve, in a child process
for plugins. Every result is judged.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ....problems.contact.solver import Solver, Stop
from ....solvers.registry import available
from ...plugins.describing import solver_spec
from ...plugins.problems import resolve_problem
from ...plugins.remote_solver import FailedSolveError, RemoteSolver
from ...simulation.generation.generate import generate_missing
from ...store.outcome import Cell, Outcome, claim_reason, point_outcome, verdicts
from ..plan import DEFAULT_SOLVERS
from ..selection import problem_name

PREPARING_SECONDS = 60.0
"""Wall time limit to prepare a cell of a built-in solver, in addition to its solve [s]."""


def default_solvers() -> list[str]:
    """Return the default solvers of a run, then all other registered ones."""
    listed = list(DEFAULT_SOLVERS)
    plain = {name.partition("(")[0] for name in listed}
    return [*listed, *(name for name in available() if name not in plain)]


def measure_matrix(
    problems: Sequence[str | ContactProblem],
    solvers: Sequence[str | Solver],
    stop: Stop,
    memory_bytes: int = 2**31,
    on_cell: Callable[[Cell], object] = lambda cell: None,
) -> list[Cell]:
    """Solve every problem with every solver once.

    Args:
        problems: names of problems, or problems. Missing problems are generated.
        solvers: solvers, or their names with options.
        stop: tolerance and limits of one solve; a solver that is not built in is killed a second after its time limit.
        memory_bytes: memory limit of a solver.
        on_cell: called with each finished cell.

    Returns:
        The cells in the order of the solvers.

    Raises:
        ProxbenchError: for an unknown problem or solver.
    """
    generate_missing(one for one in problems if isinstance(one, str))
    taken = {problem_name(one): resolve_problem(one) for one in problems}
    made = [solver_spec(solver) for solver in solvers]
    cells = []
    for solver in made:
        # built-in solvers stop by their own clock, which excludes compiling and preparing
        limit = np.inf if solver.is_built_in else stop.max_seconds
        with RemoteSolver(solver, PREPARING_SECONDS, memory_bytes, limit) as remote:
            for name, problem in taken.items():
                cells.append(_cell(remote, name, problem, stop))
                on_cell(cells[-1])
    return cells


def _cell(solver: RemoteSolver, name: str, problem: ContactProblem, stop: Stop) -> Cell:
    try:
        refusal = solver.supports(problem)
        if refusal:
            return Cell(name, solver.name, Outcome.UNSUPPORTED, reason=refusal)
        solution = solver.prepare(problem).solve(stop)
    except FailedSolveError as fault:
        return Cell(name, solver.name, fault.outcome, reason=fault.reason)
    impulses = solution.impulses
    own, coulomb = verdicts(problem, impulses, solver.model)
    outcome = point_outcome(solution.status, stop.tolerance, solver.model, own, coulomb)
    reason = claim_reason(outcome, stop.tolerance, solver.model, own.residual)
    is_finite, known = bool(np.isfinite(impulses).all()), problem.answer
    error = None
    if known is not None and is_finite:
        error = known.error(impulses, problem.relative_velocity(impulses), Residual(problem).scale)
    return Cell(
        name,
        solver.name,
        outcome,
        coulomb.residual,
        own.residual,
        solution.iterations,
        "" if outcome is Outcome.SOLVED else reason or solution.message or solution.status.sentence,
        is_finite,
        error,
    )
