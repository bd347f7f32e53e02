"""``proxbench matrix``: solve every problem with every solver once, and give the reason for each failure.

The matrix shows whether a method can solve a problem, not how fast. Each cell is one untimed solve in a child process.
Every result is judged.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ....problems.contact.solver import Solver, Stop
from ....solvers.registry import available
from ...plugins.descriptions import solver_spec
from ...plugins.problems import resolve_problem
from ...plugins.remote_solver import FailedSolveError, RemoteSolver
from ...simulation.generation.generate import generate_missing
from ...store.outcome import Cell, Outcome, claim_reason, point_outcome, verdicts
from ..plan import DEFAULT_SOLVERS
from ..refutation import without_refuted_claims
from ..selection import problem_name

PREPARATION_SECONDS = 60.0
"""Wall time by which a cell of a built-in solver may exceed the time limit of its solve, for preparation [s]."""


def default_solvers() -> list[str]:
    """Return the default solvers of a run, then all other registered ones."""
    names = list(DEFAULT_SOLVERS)
    base_names = {name.partition("(")[0] for name in names}
    return [*names, *(name for name in available() if name not in base_names)]


def measure_matrix(
    problems: Sequence[str | ContactProblem],
    solvers: Sequence[str | Solver],
    stop: Stop,
    memory_bytes: int = 2**31,
    on_cell: Callable[[Cell], object] = lambda cell: None,
) -> list[Cell]:
    """Solve every problem with every solver once.

    Args:
        problems: problems or their names; missing problems are generated.
        solvers: solvers, or their names with options.
        stop: tolerance and limits of one solve; a solver that is not built in is killed a second after its time limit.
        memory_bytes: memory limit of a solver [bytes].
        on_cell: called with each finished cell.

    Returns:
        The cells of each solver in turn, in the order of the problems. A claim that a problem has no solution is wrong
        if a solution of the solver's model is known, from the problem or from another solver.

    Raises:
        ProxbenchError: for an unknown problem or solver.
    """
    generate_missing(problem for problem in problems if isinstance(problem, str))
    resolved = {problem_name(problem): resolve_problem(problem) for problem in problems}
    specs = [solver_spec(solver) for solver in solvers]
    cells = []
    for solver in specs:
        # built-in solvers stop by their own clock, which excludes compilation and preparation
        limit = np.inf if solver.is_built_in else stop.max_seconds
        with RemoteSolver(solver, PREPARATION_SECONDS, memory_bytes, limit) as remote:
            for name, problem in resolved.items():
                cells.append(_cell(remote, name, problem, stop))
                on_cell(cells[-1])
    models = {solver.name: solver.model for solver in specs}
    answers = {name: problem.answer for name, problem in resolved.items()}
    is_solvable = {name: None if answer is None else answer.solvable for name, answer in answers.items()}
    return without_refuted_claims(cells, models, is_solvable)


def _cell(solver: RemoteSolver, name: str, problem: ContactProblem, stop: Stop) -> Cell:
    """Solve one problem with one solver, and return the judged result."""
    try:
        unsupported_reason = solver.supports(problem)
        if unsupported_reason:
            return Cell(name, solver.name, Outcome.UNSUPPORTED, reason=unsupported_reason)
        solution = solver.prepare(problem).solve(stop)
    except FailedSolveError as fault:
        return Cell(name, solver.name, fault.outcome, reason=fault.reason)
    impulses = solution.impulses
    own, coulomb = verdicts(problem, impulses, solver.model)
    outcome = point_outcome(solution.status, stop.tolerance, solver.model, own, coulomb)
    reason = claim_reason(outcome, stop.tolerance, solver.model, own.residual)
    is_finite = bool(np.isfinite(impulses).all())
    error = None
    if problem.answer is not None and is_finite:
        error = problem.answer.error(impulses, problem.relative_velocity(impulses), Residual(problem).scale)
    return Cell(
        name,
        solver.name,
        outcome,
        residual=coulomb.residual,
        model_residual=own.residual,
        iterations=solution.iterations,
        reason="" if outcome is Outcome.SOLVED else reason or solution.message or solution.status.sentence,
        is_finite=is_finite,
        answer_error=error,
    )
