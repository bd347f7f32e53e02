"""``proxbench matrix``: every solver on every problem once at one tolerance, and the reason where it does not solve.

The question is whether a method can, not how fast it is: one solve a cell, untimed, in a process that the solver may
crash or hang without harm. The judge sees every result.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ....problems.contact.problem import ContactProblem
from ....problems.contact.residual import Residual
from ....problems.contact.solver import Solver, Stop
from ....solvers.registry import available
from ...plugins.describing import solver_spec
from ...plugins.problems import resolved
from ...plugins.remote_solver import FailedSolveError, RemoteSolver
from ...store.outcome import Cell, Outcome, claim_reason, point_outcome, verdicts
from ..plan import DEFAULT_SOLVERS
from ..selection import problem_name

PREPARING_SECONDS = 60.0
"""Wall time that a cell of a built-in solver may take beyond its solve, for preparing [s]."""


def default_solvers() -> list[str]:
    """Return the solvers of a run that names none, and every other registered one."""
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
        problems: names of problems, or problems.
        solvers: solvers, or their names with options.
        stop: tolerance and limits of one solve; a solver that is not built in is ended a second after its time limit.
        memory_bytes: memory that a solver may take.
        on_cell: called with each cell as it is done.

    Returns:
        The cells, solver by solver.

    Raises:
        ProxbenchError: for an unknown problem or solver.
    """
    taken, made = {problem_name(one): resolved(one) for one in problems}, [solver_spec(solver) for solver in solvers]
    cells = []
    for solver in made:
        # built-in solvers end by their own clock, which compiling their kernels and preparing do not count for
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
