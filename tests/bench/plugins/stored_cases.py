"""Records of cases for tests, with given fields and simple defaults."""

from collections.abc import Sequence
from typing import Any

from proxbench.bench.measure.contacts.answers import judge_answers
from proxbench.bench.measure.points import keep_finest_impulses, times_from_rounds
from proxbench.bench.store.fields import Quartiles
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord, Curve, Measured, Point, Round
from proxbench.problems import ContactProblem
from proxbench.solvers import Stop, create


def timed_round(number: int, seconds: float, **others: Any) -> Round:
    """Return a round of one solve in the first session, which is not excluded."""
    times = {
        "prepare_seconds": 0.0,
        "solve_seconds": seconds,
        "total_seconds": Quartiles(min=seconds, q1=seconds, median=seconds, q3=seconds),
        "wall_seconds": seconds,
        "processor_seconds": seconds,
    }
    counts = {"session": 0, "repeats": 1, "involuntary_switches": 0, "voluntary_switches": 0, "probe_seconds": 1e-4}
    return Round(**{**times, **counts, "number": number, **others})


def measured_in(rounds: Sequence[Round], **others: Any) -> Measured:
    """Return the measurements of rounds, solved to 1e-7."""
    plain = {"iterations": 3, "residual": 1e-7, "model_residual": 1e-7, "verdict": {}, "impulse_error": None}
    return Measured(**{**plain, **times_from_rounds(rounds), "rounds": list(rounds), **others})


def case_record(**others: Any) -> CaseRecord:
    """Return a measured case of one spatial contact without points."""
    plain = {
        "problem": "p",
        "digest": "0",
        "solver": "S",
        "model": "coulomb",
        "has_iterates": True,
        "n_rows": 3,
        "n_contacts": 1,
        "outcome": Outcome.MEASURED,
        "reason": "",
        "traceback": "",
        "stderr": "",
        "wall_seconds": 1.5,
        "peak_memory_bytes": 2**40,
        "curve": Curve(),
        "points": [],
    }
    return CaseRecord(**{**plain, **others})


def solved_case(
    problem: ContactProblem, solver: str, tolerances: Sequence[float], passes: int = 2, session: int = 0
) -> CaseRecord:
    """Return a case that a solver solves here, with judged impulses and invented times."""
    made, points = create(solver), list[Point]()
    prepared = made.prepare(problem)
    for tolerance in tolerances:
        solution = prepared.solve(Stop(tolerance))
        status, answers, counts = solution.status, [solution.impulses], [solution.iterations]
        judged = judge_answers(problem, made.model, tolerance, status, answers, iterations=counts)
        measured = measured_in(
            [timed_round(number, 1e-3 + 1e-5 * number, session=session) for number in range(passes)],
            iterations=judged.iterations,
            residual=judged.coulomb.residual,
            model_residual=judged.own.residual,
            verdict=judged.coulomb.numeric_fields(),
            impulses=judged.worst_impulses,
            impulse_error=judged.impulse_error(problem),
        )
        points.append(
            Point(tolerance=tolerance, outcome=judged.outcome, status=status.value, reason="", measured=measured)
        )
    return case_record(
        problem=problem.name,
        digest=problem.digest,
        solver=made.name,
        model=str(made.model),
        n_rows=problem.n_rows,
        n_contacts=problem.n_contacts,
        points=keep_finest_impulses(points),
    )
