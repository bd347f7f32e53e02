"""The times of a study are the clock times of its undisturbed members."""

from typing import Any

import pytest
from holding_solver import PAUSE_SECONDS, Holding
from proxbench.bench.isolation.worker import Fault
from proxbench.bench.measure.ladder import CasePass
from proxbench.bench.measure.trajectories.case import Member, SimulationRound, TrajectoryCase
from proxbench.bench.measure.trajectories.methods import make_method
from proxbench.bench.measure.trajectories.plan import LIMITS
from proxbench.bench.measure.trajectories.task import TrajectoryTask
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import Point
from proxbench.problems.motion.trajectories.problem import EndPosition, TrajectoryProblem
from stored_cases import measured_in, timed_round

VALUES = {"q": 1.0}


@pytest.fixture
def case() -> TrajectoryCase:
    """Return a case of three members without measurements."""
    problem = TrajectoryProblem("sliding_sphere", 0.02, (0.9, 1.0, 1.1), EndPosition(VALUES, 1.0))
    method = make_method("Holding in Moreau(step=1e-3)", [1e-6], specification=solver_spec(Holding()))
    return TrajectoryCase(problem, method, LIMITS, None, CasePass())


def simulated(**changes: Any) -> SimulationRound:
    """Return a simulation of 20 steps in 2 ms."""
    counts = {
        "iterations": 20,
        "steps": 20,
        "unsolved": 0,
        "overlapping": 0,
        "involuntary": 0,
        "voluntary": 0,
        "waited": 0.0,
    }
    times = {"prepare": [0.0], "solve": [2e-3], "processor": [2e-3]}
    return SimulationRound.read(
        {"status": "solved", "message": "", **counts, **times, "values": VALUES, **changes}, 1.0
    )


def test_a_solver_that_pretends_to_compile_gains_no_time_and_sleeps_without_a_processor(case: TrajectoryCase) -> None:
    answer, _ = TrajectoryTask(case.problem, case.method, 60.0).answer("simulate", (1e-6, 1.0))
    read = SimulationRound.read(answer, 60.0)
    wall, slept = float(read.totals.sum()), PAUSE_SECONDS * read.iterations
    assert read.status == "solved"
    assert read.steps == 20
    assert wall > slept > 0.0
    assert 0.0 < sum(read.processor) <= wall - slept + 1e-3


def test_a_point_has_the_times_of_its_undisturbed_members_and_keeps_all_rounds(case: TrajectoryCase) -> None:
    rounds = [
        timed_round(0, 1.0, turn=0, processor_seconds=0.5, excluded="preempted"),
        timed_round(0, 3.0, turn=1, processor_seconds=2.0),
        timed_round(0, 5.0, turn=2, processor_seconds=4.0),
    ]
    measured = case.point(1e-6, [Member(simulated(), one) for one in rounds]).measured
    assert measured is not None
    assert (measured.rounds, measured.repeats, measured.is_excluded) == (rounds, 3, False)
    assert measured.total_seconds.median == 4.0
    assert measured.processor_seconds is not None
    assert measured.processor_seconds.median == 3.0


def test_failed_members_are_counted_but_excluded_from_the_times(case: TrajectoryCase) -> None:
    good, failed = simulated(), simulated(values={}, status="stalled")
    answers = [(good, 1.0), (failed, 9.0), (good, 3.0)]
    measured = case.point(1e-6, [Member(one, timed_round(0, seconds)) for one, seconds in answers]).measured
    assert measured is not None
    assert (len(measured.rounds), measured.repeats, measured.failed_members) == (3, 2, 1)
    assert measured.total_seconds.median == 2.0


@pytest.mark.parametrize(
    ("outcome", "reason", "ends"),
    [
        (Outcome.SOLVED, "", ""),
        (Outcome.STALLED, "a step failed", ""),
        (Outcome.TIME_LIMIT, "given up", f"0.001 already took longer than {LIMITS.solve_seconds:g} s"),
        (Outcome.NOT_ATTEMPTED, "0.01 already took longer", "0.01 already took longer"),
    ],
)
def test_finer_points_are_simulated_unless_a_coarser_one_took_too_long(
    outcome: Outcome, reason: str, ends: str, case: TrajectoryCase
) -> None:
    """If a coarser point fails, a finer one need not fail."""
    measured = None if outcome is Outcome.NOT_ATTEMPTED else measured_in([timed_round(0, 1.0)])
    point = Point(tolerance=1e-3, outcome=outcome, status=outcome.value, reason=reason, measured=measured)
    assert case.reason_to_stop(point) == ends


@pytest.mark.parametrize("changes", [{"values": {}}, {"solve": [2.0]}, {"processor": []}, {"steps": -1}])
def test_impossible_answer_of_a_case_is_a_fault(changes: dict[str, Any]) -> None:
    with pytest.raises(Fault):
        simulated(**changes)


def test_threads_beyond_the_readings_of_the_clocks_exceed_one_core() -> None:
    assert not simulated(processor=[2e-3 + 20 * 4e-6]).exceeds(1)
    assert simulated(processor=[4e-3]).exceeds(1)
    assert not simulated(processor=[4e-3]).exceeds(2)
