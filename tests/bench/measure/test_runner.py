"""A run follows the protocol, keeps finished results, and resumes where it stopped."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import numpy as np
import pytest
import scipy.sparse as sp
from misbehaving_solvers import Misbehaving
from proxbench.bench import load, resume, run
from proxbench.bench.errors import BenchError
from proxbench.bench.measure import runner
from proxbench.bench.measure.contacts.case_process import Measurement
from proxbench.bench.measure.execution.events import CaseFinished, RunStarted
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import PASSES, Limits
from proxbench.bench.store.store import Store
from proxbench.problems import ContactProblem, judge
from proxbench.problems import load as load_problem
from proxbench.solvers import Status, Stop, create


def test_every_attempt_is_a_row(finished_run: Path) -> None:
    frames = load(finished_run)
    assert len(frames.cases) == 15
    assert frames.damaged == []
    outcomes = frames.cases.set_index(["problem", "solver"])["outcome"]
    assert (outcomes[:, "Misbehaving(raise)"] == Outcome.CRASHED).all()
    assert (outcomes[:, "SORprox"] == Outcome.MEASURED).all()


def test_a_point_has_a_timed_solve_in_every_pass_and_a_failure_one(finished_run: Path) -> None:
    run = load(finished_run)
    points = run.points
    solved = points[points["outcome"] == Outcome.SOLVED]
    assert (solved["repeats"] >= run.info.plan.passes).all()
    assert (points[points["outcome"] == Outcome.OSCILLATING]["repeats"] == 1).all()
    assert (solved["total_seconds"] >= solved["solve_seconds"]).all()


def test_after_a_failure_finer_tolerances_are_not_attempted_and_say_why(finished_run: Path) -> None:
    points = load(finished_run).points
    swept = points[(points["problem"] == "hard-counterexample") & (points["solver"] == "SORprox")]
    assert swept["outcome"].tolist() == [Outcome.OSCILLATING, Outcome.NOT_ATTEMPTED, Outcome.NOT_ATTEMPTED]
    assert "0.01 already ended oscillating" in swept["reason"].iloc[-1]


def test_false_claims_are_wrong_and_relaxed_models_are_relaxed(finished_run: Path) -> None:
    points = load(finished_run).points
    claims = points[(points["solver"] == "Misbehaving(lie)") & (points["residual"] > 10 * points["tolerance"])]
    assert len(claims) == 8
    assert set(claims["outcome"]) == {Outcome.WRONG}
    conic = points[(points["solver"] == "ClarabelSOCP") & (points["problem"] == "funnel-30")]
    assert set(conic["outcome"]) == {Outcome.RELAXED}
    assert conic["residual"].between(0.05, 0.5).all()
    assert (conic["model_residual"] <= conic["tolerance"]).all()


def test_an_infeasible_problem_is_reported_as_such(finished_run: Path) -> None:
    points = load(finished_run).points
    found = points[(points["problem"] == "hard-immovable") & (points["solver"] == "SORprox")]
    assert found["outcome"].iloc[0] == Outcome.INFEASIBLE


def test_the_curve_is_that_of_the_observed_solve(finished_run: Path) -> None:
    frames = load(finished_run)
    curve = frames.iterations.query("problem == 'funnel-30' and solver == 'SORprox(relaxation=0.5)'")
    assert curve["iteration"].is_monotonic_increasing
    assert curve["iteration"].iloc[0] == 1
    problem = load_problem("funnel-30")
    once = create("SORprox", relaxation=0.5).prepare(problem).solve(Stop(1e-300, 1))
    assert curve["residual"].iloc[0] == pytest.approx(judge(problem, once.impulses).residual, rel=1e-12)


def test_the_curve_ends_where_the_observed_solve_does(finished_run: Path) -> None:
    frames = load(finished_run)
    curve = frames.iterations.query("problem == 'funnel-30' and solver == 'SORprox(relaxation=0.5)'")
    finest = frames.points.query("problem == 'funnel-30' and solver == 'SORprox(relaxation=0.5)'").iloc[-1]
    assert curve["iteration"].iloc[-1] == finest["iterations"] > 100
    assert curve["residual"].iloc[-1] <= finest["tolerance"]
    assert (curve["iteration"].tail(20).diff().dropna() == 1).all()


def test_known_impulses_are_compared(finished_run: Path) -> None:
    points = load(finished_run).points
    solved = points.query("problem == 'hard-counterexample' and outcome == 'solved' and tolerance == 1e-6")
    assert (solved["impulse_error"] <= 1e-6).all()


def test_run_json_describes_the_machine_and_the_core_of_its_session(finished_run: Path) -> None:
    info = load(finished_run).info
    assert info.machine.processor
    assert info.machine.versions["numpy"] == np.__version__
    (session,) = info.sessions
    assert len(session.busy_cores) >= 3 * info.plan.passes
    assert session.core in os.sched_getaffinity(0)
    assert session.machine == info.machine
    assert session.started <= session.finished


def test_a_run_that_another_processor_began_is_not_resumed(finished_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = msgspec.structs.replace(this_machine(), processor="another")
    monkeypatch.setattr(runner, "this_machine", lambda: machine)
    with pytest.raises(BenchError, match=r"started with another machine or source \(processor .*, now another"):
        resume(finished_run)


@pytest.mark.slow
def test_resume_measures_the_missing_and_the_damaged_and_keeps_the_rest(tmp_path: Path) -> None:
    solvers = ["SORprox", "Jprox"]
    folder = run(
        ["hard-tresca-joint", "hard-no-motion"], solvers, results=tmp_path, tolerances=[1e-2, 1e-4], passes=1
    ).folder
    files = sorted((folder / "cases").iterdir())
    kept = {(case.problem, case.solver): case for case in Store.open(folder).read_cases()[0]}
    files[0].unlink()
    files[1].write_bytes(files[1].read_bytes()[:-40])
    events: list[object] = []
    assert resume(folder, on_event=events.append).folder == folder
    started = next(event for event in events if isinstance(event, RunStarted))
    assert (started.done, started.total) == (2, 4)
    assert sum(isinstance(event, CaseFinished) for event in events) == 2
    assert sorted((folder / "cases").iterdir()) == files
    cases, damaged = Store.open(folder).read_cases()
    assert not damaged
    sessions = [
        [[one for one in point.rounds if one.session == 0] for point in case.points]
        for case in cases
        if kept[case.problem, case.solver].points[0].rounds[0] in case.points[0].rounds
    ]
    assert len(sessions) == 2
    assert all(len(rounds) >= PASSES for points in sessions for rounds in points)


def test_unwritable_folder_is_reported_before_any_measurement(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    events: list[object] = []
    with pytest.raises(Exception, match="cannot write"):
        run(["hard-no-motion"], ["SORprox"], results=tmp_path / "file", on_event=events.append)
    assert events == []


@pytest.mark.slow
@pytest.mark.parametrize("megabytes", [80, 112, 128])
def test_a_matrix_beyond_the_memory_limit_is_out_of_memory_in_one_sentence(tmp_path: Path, megabytes: int) -> None:
    """All pairs of 3000 grains on one slab are coupled; G therefore takes 108 MB, and a sweep another 36 MB."""
    n = 3000
    slab = sp.csc_array(np.vstack([np.eye(n), -np.ones(n)]))
    problem = ContactProblem.from_factors(slab, np.ones(n + 1), np.full(n, -0.01), dim=1, name="slab")
    found = run([problem], ["NSGS"], results=tmp_path, tolerances=[1e-2], passes=1, memory=megabytes)
    (case,) = found.cases.to_dict("records")
    assert case["outcome"] == Outcome.OUT_OF_MEMORY
    assert "for G of 3,000 contacts" in case["reason"]
    assert case["reason"].endswith("use a solver over the factors, such as SORprox(form='factors')")


@pytest.mark.slow
def test_a_problem_and_a_solver_can_be_objects(tmp_path: Path) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3, name="mine")
    folder = run([problem], [create("SORprox"), Misbehaving("exit")], results=tmp_path, tolerances=[1e-6], passes=1)
    cases = load(folder).cases
    assert cases["problem"].tolist() == ["mine", "mine"]
    assert cases["outcome"].tolist() == [Outcome.MEASURED, Outcome.CRASHED]


@pytest.mark.parametrize("name", ["Jprox", "JORprox(relaxation=0.5)", "SORprox", "SORprox(form='factors')"])
def test_observed_and_timed_solves_end_in_the_same_bits(name: str) -> None:
    problem = load_problem("funnel-30")
    measurement = Measurement(problem, create(name))
    stop = Stop(1e-5, 500, 10.0)
    timed, answers = measurement.round(stop, 0.0)
    observed = create(name).prepare(problem.fresh()).solve(stop, observe=lambda iteration, impulses: None)
    assert answers[-1].tobytes() == observed.impulses.tobytes()
    assert timed.status is observed.status


def test_a_round_goes_on_for_its_time_but_a_failure_is_measured_once() -> None:
    problem = load_problem("hard-counterexample")
    measurement = Measurement(problem, create("SORprox", relaxation=0.5))
    measurement.warm_up(Stop(1e-6))
    found, _ = measurement.round(Stop(1e-6), 0.05)
    assert found.status is Status.SOLVED
    assert len(found.processor) > 3
    failed, _ = Measurement(problem, create("SORprox")).round(Stop(1e-6), 0.05)
    assert len(failed.processor) == 1


@pytest.mark.slow
def test_interruption_keeps_finished_cases_and_resumes(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-c",
        "from proxbench.bench.cli.main import main; main()",
        "run",
        "--output",
        str(tmp_path),
    ]
    names = ["hard-no-motion", "hard-tresca-joint", "funnel-100", "funnel-1000"]
    command += ["--run-id", "x", "--solver", "SORprox", "--solver", "Jprox"]
    command += [word for name in names for word in ("--problem", name)]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a background shell may ignore it
    )
    cases = tmp_path / "x" / "cases"
    deadline = time.monotonic() + 600
    while time.monotonic() < deadline and len(list(cases.glob("*.json"))) < 2:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 130
    assert "--resume" in errors
    finished = list(cases.iterdir())
    assert 2 <= len(finished) < 2 * len(names)
    assert all(file.suffix == ".json" for file in finished)
    assert all(json.loads(file.read_text())["outcome"] == "measured" for file in finished)
    assert not os.path.exists(f"/proc/{process.pid}")


@pytest.mark.slow
def test_limits_are_those_of_the_plan(tmp_path: Path) -> None:
    folder = run(
        ["funnel-30"],
        [Misbehaving("sleep")],
        results=tmp_path,
        tolerances=[1e-1],
        limits=Limits(solve_seconds=0.1, case_seconds=0.5),
    )
    case = load(folder).cases.iloc[0]
    assert case["outcome"] == Outcome.TIMEOUT
    assert "longer than its 0.5 s" in case["reason"]
    assert 0.5 <= case["wall_seconds"] < Limits().case_seconds


@pytest.mark.weekly
def test_a_script_without_a_main_guard_is_run_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from proxbench.bench import load, run\n"
        "print('begin')\n"
        f"results = {str(tmp_path)!r}\n"
        "made = run(['hard-no-motion'], ['SORprox', 'Jprox'], results=results, tolerances=[1e-2], passes=1)\n"
        "print(load(made.folder).cases['outcome'].tolist())\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=600)
    assert done.stdout.splitlines() == ["begin", "['measured', 'measured']"]
