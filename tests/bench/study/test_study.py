"""Stored studies: they go on where they ended, and damaged ones are told from good ones."""

import json
from pathlib import Path
from typing import Any

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.study import running
from proxbench.bench.study.defaults import make_study_plan
from proxbench.bench.study.measuring import ERROR, Measured
from proxbench.bench.study.plan import Case, StudyPlan, plan_from
from proxbench.bench.study.running import advance_study, failures, points, run_study
from proxbench.bench.study.study import Study, read_study
from proxbench.problems import ProxbenchError

from .conftest import fixed_case, toy_case, toy_plan

PLAN = toy_plan(fixed_case(100, members=(0.9, 1.0, 1.1)), toy_case())


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """Series and members that were measured; nothing is simulated."""
    calls: list[tuple[str, float]] = []

    def measure(plan: StudyPlan, case: Case, member: float, should_stop: Any) -> Measured | None:
        if should_stop():
            return None
        calls.append((case.series, member))
        failed = member > 1.0
        return Measured(0.1, 10, 0, {} if failed else {ERROR: 1e-3 * member}, "it burst" if failed else "")

    monkeypatch.setattr(running, "measure", measure)
    monkeypatch.setattr(running, "warm_up", lambda plan, case, should_stop: None)
    return calls


def test_an_interrupted_study_goes_on_with_what_is_left(asked: list[tuple[str, float]], tmp_path: Path) -> None:
    file = tmp_path / "study.json"
    run_study(PLAN, file, should_stop=lambda: len(asked) == 2)
    assert asked == [("fixed", 0.9), ("Extrapolated", 1.0)]
    stored = read_study(file)
    assert not stored.is_finished
    advance_study(stored)
    assert asked[2:] == [("fixed", 1.0), ("fixed", 1.1)]
    again = read_study(file)
    assert again.is_finished
    assert again.plan == PLAN
    assert again.measured == stored.measured
    assert [path.name for path in tmp_path.iterdir()] == ["study.json"]


def test_a_failure_is_told_and_counted(asked: list[tuple[str, float]]) -> None:
    study = run_study(PLAN)
    assert len(asked) == 4
    fixed, variable = points(study)
    assert (fixed.error, fixed.members, fixed.failed) == (pytest.approx(0.95e-3), 2, 1)
    assert variable.failed == 0
    (sentence,) = failures(study)
    assert sentence.endswith("it burst")


def test_default_plans_can_be_stored_and_read() -> None:
    for plan in (make_study_plan("woodpecker"), make_study_plan("funnel", {"balls": 3, "friction": None}, seeds=2)):
        document = json.loads(json.dumps(plan.document()))
        assert Study(plan).plan.n_runs == sum(len(case["members"]) for case in document["cases"])
        assert plan_from(document) == plan


def test_a_solver_that_is_asked_for_is_compared_too() -> None:
    plan = make_study_plan("pile", {"balls": 3}, solvers=["Jprox"])
    assert {case.solver for case in plan.cases} >= {"Jprox", "NSGS"}


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        ("funel", {}, "there is no study of 'funel'"),
        ("woodpecker", {"options": {"gravity": 1.0}}, "leave gravity out"),
        ("woodpecker", {"duration": 1.0}, "leave --duration out"),
        ("funnel", {"seeds": 1}, "at least 2"),
        ("funnel", {"options": {"balls": 0}}, "balls"),
        ("funnel", {"duration": -1.0}, "duration"),
        ("funnel", {"solvers": ["SORprx"]}, "SORprox"),
    ],
)
def test_a_study_that_cannot_be_is_refused(scene: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ProxbenchError, match=words):
        make_study_plan(scene, **options)


def spoilt(content: dict[str, Any], *path: Any, value: Any) -> str:
    place: Any = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return json.dumps(content)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("kind",), "cake", "holds no study"),
        (("format",), 99, "format 99"),
        (("plan",), 3, "damaged"),
        (("plan", "scene"), "kitchen", "kitchen"),
        (("plan", "cases", 0, "solver"), "SORprx", "SORprox"),
        (("plan", "cases", 0, "stepper"), "Extrapolated", "damaged"),
        (("plan", "cases", 0, "members"), [], "damaged"),
        (("plan", "cases", 0, "members"), ["a"], "damaged"),
        (("plan", "cases", 0, "max_iterations"), 1.5, "damaged"),
        (("runs", 0, "case"), 7, "damaged"),
        (("runs", 0, "member"), -1, "damaged"),
        (("runs", 0, "wall"), "long", "damaged"),
        (("runs", 0, "values"), {ERROR: None}, "damaged"),
        (("runs", 0, "failure"), 1, "damaged"),
    ],
)
def test_a_file_that_is_no_study_gets_one_sentence(
    asked: list[tuple[str, float]], tmp_path: Path, path: tuple[Any, ...], value: Any, words: str
) -> None:
    file = tmp_path / "study.json"
    run_study(PLAN, file)
    file.write_text(spoilt(json.loads(file.read_text()), *path, value=value))
    with pytest.raises(BenchError, match=words):
        read_study(file)


def test_a_file_that_is_cut_off_is_damaged(asked: list[tuple[str, float]], tmp_path: Path) -> None:
    file = tmp_path / "study.json"
    run_study(PLAN, file)
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(BenchError, match="damaged"):
        read_study(file)
