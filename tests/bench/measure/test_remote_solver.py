"""A solver in a separate process gives the same answers, and its faults are errors of one solve."""

import numpy as np
import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.plugins.remote_solver import FailedSolveError, RemoteSolver
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import load
from proxbench.solvers import Stop, create

STOP = Stop(1e-8, 500)


def test_impulses_iterates_and_status_are_those_of_the_solver_itself() -> None:
    problem, name = load("funnel-30"), "SORprox(relaxation=1.5)"
    start = np.full(problem.n_rows, 1e-3)
    seen: dict[str, list[tuple[int, bytes]]] = {"here": [], "there": []}
    here = create(name).prepare(problem)
    own = here.solve(STOP, start, lambda k, impulses: seen["here"].append((k, impulses.tobytes())))
    with RemoteSolver(solver_spec(name)) as solver:
        assert solver.supports(problem) is None
        there = solver.prepare(problem)
        found = there.solve(STOP, start, lambda k, impulses: seen["there"].append((k, impulses.tobytes())))
    assert found.impulses.tobytes() == own.impulses.tobytes()
    assert (found.status, found.iterations, found.message) == (own.status, own.iterations, own.message)
    assert seen["here"] == seen["there"]
    assert len(seen["there"]) == own.iterations


def test_prepared_problems_may_be_solved_in_turn() -> None:
    problems = [load("hard-groove"), load("hard-sticking-box")]
    with RemoteSolver(solver_spec("NSGS")) as solver:
        prepared = [solver.prepare(problem) for problem in problems]
        for _ in range(2):
            for one, problem in zip(prepared, problems, strict=True):
                own = create("NSGS").prepare(problem).solve(STOP)
                assert one.solve(STOP).impulses.tobytes() == own.impulses.tobytes()


def test_a_later_supports_call_does_not_replace_the_prepared_problem() -> None:
    first, second = load("hard-groove"), load("hard-sticking-box")
    with RemoteSolver(solver_spec("NSGS")) as solver:
        prepared = solver.prepare(first)
        assert solver.supports(second) is None
        assert prepared.solve(STOP).impulses.tobytes() == create("NSGS").prepare(first).solve(STOP).impulses.tobytes()


def test_unsupported_reason_is_returned() -> None:
    with RemoteSolver(solver_spec("Enumeration")) as solver:
        assert solver.supports(load("funnel-30")) == create("Enumeration").supports(load("funnel-30"))


def test_a_warm_solver_never_starts_from_zero_under_that_name() -> None:
    with RemoteSolver(solver_spec("Warm(NSGS)")) as solver:
        assert "only `proxbench run`" in str(solver.supports(load("funnel-30")))


@pytest.mark.parametrize(
    ("action", "outcome"),
    [
        ("raise", Outcome.CRASHED),
        ("segfault", Outcome.CRASHED),
        ("nan", Outcome.MISBEHAVED),
        ("write", Outcome.MISBEHAVED),
    ],
)
def test_a_fault_is_an_error_of_that_solve_and_the_next_request_has_a_fresh_process(
    action: str, outcome: Outcome
) -> None:
    problem = load("hard-groove")
    with RemoteSolver(solver_spec(Misbehaving(action))) as solver:
        for _ in range(2):
            with pytest.raises(FailedSolveError) as raised:
                solver.prepare(problem).solve(STOP)
            assert raised.value.outcome is outcome
            assert solver.supports(problem) is None


def test_the_process_of_a_solver_ends_after_an_invalid_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load("hard-groove")
    with RemoteSolver(solver_spec("NSGS")) as solver:
        prepared = solver.prepare(problem)
        (worker,) = solver._workers
        monkeypatch.setattr(worker, "ask", lambda *request: ({}, b""))
        with pytest.raises(FailedSolveError, match="its process sent an invalid answer"):
            prepared.solve(STOP)
        assert worker.process == 0
        assert prepared.solve(STOP).impulses.tobytes() == create("NSGS").prepare(problem).solve(STOP).impulses.tobytes()


@pytest.mark.slow
def test_a_solver_that_hangs_is_ended_in_time() -> None:
    with (
        RemoteSolver(solver_spec(Misbehaving("sleep")), seconds=2.0) as solver,
        pytest.raises(FailedSolveError) as raised,
    ):
        solver.prepare(load("hard-groove")).solve(Stop(1e-8, 10, 0.1))
    assert raised.value.outcome is Outcome.TIMEOUT


@pytest.mark.slow
def test_a_solve_has_its_own_seconds_beyond_those_of_a_request() -> None:
    with RemoteSolver(solver_spec(Misbehaving("sleep")), seconds=0.5) as solver:
        prepared = solver.prepare(load("hard-groove"))
        with pytest.raises(FailedSolveError) as raised:
            prepared.solve(Stop(1e-8, 10, 1.0))
    assert "longer than its 1.5 s" in raised.value.reason
