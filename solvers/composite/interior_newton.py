"""InteriorNewton: interior points identify contact states; sweeps and Newton's method refine impulses.

From any start, an interior point method takes a few dozen factorisations to identify which contacts open, stick and
slip. It finds the last digits slowly if the solution is not strictly complementary, and its path may turn back. A few
hundred sweeps with momentum usually find these digits, and cost less than two factorisations. The methods alternate:

    InteriorPoint      fast if the path parameter τ can decrease steadily
    NesterovSORprox    the last digits, from the end of that run
    ClarabelCoulomb    from zero, if cone programs are cheap, while each program gains a digit
    CentralPath        follows the path from its beginning, through its turns
    NesterovSORprox    from the end of the path
    ProximalPoint      also from the end of the path: Newton's method, regular for any number of redundant contacts
    HybridNewton       from the best impulses: sweeps that change contact states one by one if no path helps

Where other sweeps are faster than ``NesterovSORprox``, they replace it (``sweep_selection``). The last four methods run
in five rounds, with increasing iteration limits for the path and ``HybridNewton``. The path continues where it stopped.
If it has ended, and in the fourth round, it restarts with series of another order, which may not cycle where series of
the first order do. When both paths have ended, ``ProximalPoint`` starts from the best impulses. Before the last round,
``SemismoothNewton`` starts from zero, because the other methods may all lead to the same iterate. No method delays the
others for long, and the runs do not depend on the speed of the machine.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.matrices.pieces import Pieces
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Prepared, Solution, Solver, Stop, check_stop
from ..interior.central_path import CentralPath, ResumablePath
from ..interior.interior_point import InteriorPoint
from ..interior.runs import PreparedRuns, SingleRun
from ..iteration.method import Method
from ..iteration.stopping import Clock
from ..newton.proximal_point import ProximalPoint
from ..newton.semismooth_newton import SemismoothNewton
from .hybrid_newton import HybridNewton
from .sequence import SolverRun, SolverSequence
from .sweep_selection import FACTORS_READ_RATIO, compute_read_ratio, refining_sweeps
from .work import MAX_STEPS, program_seconds, step_seconds

MAX_FIRST_STEPS, MAX_SWEEPS, MAX_PROXIMAL_STEPS, MAX_NEWTON_STEPS = 80, 500, 40, 500
"""Iteration limits of ``InteriorPoint``, of sweeps, of ``ProximalPoint`` and of ``SemismoothNewton``."""

PATH_ROUNDS = ((6, 100), (6, 200), (6, 400), (10, 1000), (6, 1000))
"""Order and iteration limit of ``CentralPath`` in each round."""

HYBRID_LIMITS = (500, 1000, 2000, 2000)
"""Iteration limits of ``HybridNewton`` in all rounds but the last, in which only the limit of the solve applies."""

REDUNDANCY = 2
"""Rows per degree of freedom above which interior point methods may factorise over bodies."""

MAX_OPERATIONS = 1e300
"""Number of operations returned for a factorisation that does not fit into memory."""


@dataclass(frozen=True)
class InteriorNewton(Method):
    """Interior points, the central path through its turns, sweeps and Newton's method, in sequence.

    One iteration is a Newton step, a factorisation of the path, a cone program, or a sweep. Interior point methods
    factorise over bodies if several contacts of the same two bodies over-determine their motion, otherwise over
    contacts.
    """

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return InteriorPoint().supports(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedInteriorNewton":
        """Prepare the first method; the others are prepared when they first run."""
        first = first_method(problem)
        return PreparedInteriorNewton(problem, Residual(problem), {first.name: first.prepare(problem)})


@dataclass(frozen=True, eq=False)
class PreparedInteriorNewton:
    """The prepared methods of one problem, by name."""

    problem: ContactProblem
    residual: Residual = field(repr=False)
    prepared: dict[str, Prepared] = field(repr=False)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Run the methods until one solves the problem; see ``Prepared.solve``."""
        check_stop(stop)
        sequence = SolverSequence(self.problem, self.residual, self.prepared, stop, observe, Clock(stop.max_seconds))
        return run_sequence(sequence, start)


def run_sequence(sequence: SolverSequence, start: FloatArray | None) -> Solution:
    """Run the methods of ``InteriorNewton``; the first begins at ``start``, shape (n_rows,), or at zero."""
    for run in _runs(sequence, start):
        solution = sequence.run(run)
        if solution is not None:
            return solution
    return sequence.finish(sequence.status)


def first_method(problem: ContactProblem) -> SingleRun:
    """Return the first method, an interior point method in the form for ``problem``."""
    return SingleRun(InteriorPoint(form=form_for(problem)))


def count_operations(sequence: SolverSequence) -> float:
    """Return the number of operations of one factorisation of the first method, which is prepared if necessary.

    Return ``MAX_OPERATIONS`` if the memory does not suffice for one.
    """
    prepared = sequence.prepare(first_method(sequence.problem))
    return prepared.system.flops if isinstance(prepared, PreparedRuns) else MAX_OPERATIONS


def cone_programs(problem: ContactProblem, operations: float) -> Solver | None:
    """Return De Saxcé's fixed point in the form in which sweeps are faster, or None.

    Return None if the problem has no cone program, or if one takes more work than ``MAX_STEPS`` interior point steps
    with ``operations`` per factorisation.
    """
    if program_seconds(operations) > MAX_STEPS * step_seconds(problem, operations):
        return None
    from ..conic.clarabel_coulomb import ClarabelCoulomb  # imported here because the import takes 20 ms
    from ..conic.fixed_point import FastFixedPoint

    forms: list[Literal["delassus", "factors"]] = ["delassus"]
    if problem.factors is not None and compute_read_ratio(problem) > FACTORS_READ_RATIO:
        forms.insert(0, "factors")
    methods = (FastFixedPoint(ClarabelCoulomb(form)) for form in forms)
    return next((method for method in methods if method.supports(problem) is None), None)


def form_for(problem: ContactProblem) -> Literal["delassus", "factors"]:
    """Return the form of the methods: "factors" if contacts of the same two bodies over-determine their motion.

    Such contacts, of a pair of bodies or of a body and the ground, are redundant, and G has a dense block for every two
    of them. Otherwise a step over bodies saves little, and ends at a larger residual because contact velocities are
    differences of body velocities.
    """
    if problem.factors is None or problem.n_rows <= REDUNDANCY * problem.factors.n_dofs:
        return "delassus"
    pieces = problem.factor_pieces()
    return "factors" if problem.n_rows > pieces.length * _n_pairs(pieces) else "delassus"


def _n_pairs(pieces: Pieces) -> int:
    """Return the number of different sets of bodies that contacts touch, each identified by its first and last body."""
    block = np.repeat(np.arange(pieces.n_blocks), np.diff(pieces.starts))
    first, last = np.full(pieces.n_blocks, pieces.n_chunks), np.full(pieces.n_blocks, -1)
    is_body_piece = pieces.chunks < pieces.n_chunks
    np.minimum.at(first, block[is_body_piece], pieces.chunks[is_body_piece])
    np.maximum.at(last, block[is_body_piece], pieces.chunks[is_body_piece])
    return len(np.unique(first * (pieces.n_chunks + 1) + last))


def _runs(sequence: SolverSequence, start: FloatArray | None) -> Iterator[SolverRun]:
    """Yield the runs in order; each depends on the results of the previous runs."""
    problem = sequence.problem
    zeros, form = np.zeros(problem.n_rows), form_for(problem)
    yield sequence.plan(first_method(problem), zeros if start is None else start, MAX_FIRST_STEPS)
    sweeps, end = refining_sweeps(problem), sequence.latest
    yield sequence.plan(sweeps, end, MAX_SWEEPS)
    programs = cone_programs(problem, count_operations(sequence))
    if programs is not None:
        yield sequence.plan(programs, None, sequence.stop.max_iterations)
    methods = [CentralPath(order, form) for order, _ in PATH_ROUNDS]
    paths = {path.order: ResumablePath(path, problem) for path in methods if path.supports(problem) is None}
    hybrid_limits = (*HYBRID_LIMITS, sequence.stop.max_iterations)
    rounds = zip(PATH_ROUNDS, hybrid_limits, strict=True)
    for number, ((order, factorisations), hybrid_limit) in enumerate(rounds, start=1):
        if number == len(PATH_ROUNDS):
            yield sequence.plan(SemismoothNewton(), zeros, MAX_NEWTON_STEPS)
        path = paths.get(order) or next(iter(paths.values()), None)
        if path is not None:
            yield SolverRun(path.method.name, path, zeros, factorisations)
            end = sequence.latest
            if path.has_ended:
                del paths[path.method.order]
            yield sequence.plan(sweeps, end, MAX_SWEEPS)
        # swept impulses may have a lower residual than the end of the path, but identify the states less well
        yield sequence.plan(ProximalPoint(), end, MAX_PROXIMAL_STEPS)
        yield sequence.plan(HybridNewton(), sequence.best_impulses, hybrid_limit)
        end = sequence.best_impulses  # without a path, the same start would repeat the same steps
