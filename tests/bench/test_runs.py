"""Runs from Python: arguments, results, and later use of their folder alone."""

import dataclasses
import os
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench import bench
from proxbench.bench import Run, load, resume, run
from proxbench.bench.errors import BenchError
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems import ContactProblem, ProblemError, save_problem
from proxbench.problems import load as load_problem
from proxbench.problems.exchange.catalog import SUITES
from proxbench.problems.exchange.plugins.offers import forget, registered


def falling(name: str = "mine", weight: float = 1.0) -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(3), (-weight, 0.5, 0.0), 0.3, name=name)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(falling(), "SORprox", results=tmp_path_factory.mktemp("results"), run_id="it", tolerances=1e-4, passes=1)


@pytest.mark.weekly
def test_single_values_and_lists_give_the_same_run(finished: Run, tmp_path: Path) -> None:
    listed = run([falling()], ["SORprox"], results=tmp_path, tolerances=[1e-4], passes=1)
    same = ["problem", "solver", "digest", "outcome"]
    assert listed.cases[same].to_dict() == finished.cases[same].to_dict()
    assert listed.points["residual"].tolist() == finished.points["residual"].tolist()


def test_a_run_is_the_path_of_its_folder_and_loads_as_it_was_returned(finished: Run) -> None:
    assert Path(finished) == finished.folder == Path(os.fspath(finished))
    for again in (load(finished), load(str(finished.folder)), load(finished.folder)):
        assert again.info == finished.info
        assert again.points.equals(finished.points)
        assert again.is_finished


def test_a_printed_run_says_how_its_cases_ended_and_where_it_is(finished_run: Path) -> None:
    run = load(finished_run)
    first, second = str(run).splitlines()
    assert first.startswith("15 of 15 cases: ")
    counts = dict(reversed(part.split(" ", 1)) for part in first.partition(": ")[2].split(", "))
    assert sum(map(int, counts.values())) == 15
    assert counts["crashed"] == "3"
    assert second == f"stored in {finished_run}"


@pytest.mark.slow
def test_limits_are_given_by_name_and_keep_the_others(tmp_path: Path) -> None:
    made = run(
        falling(),
        "SORprox",
        results=tmp_path,
        tolerances=1e-2,
        limits=Limits(max_iterations=7),
        solve_seconds=3.0,
        case_seconds=30.0,
        memory=512,
    )
    assert made.info.plan.limits == Limits(3.0, 30.0, 512 * 2**20, 7)
    with pytest.raises(BenchError, match="`memory` must be at least 1 MiB and finite, got 0 MiB"):
        run(falling(), "SORprox", results=tmp_path, memory=0)


@pytest.mark.slow
def test_a_problem_file_is_measured_like_the_problem_in_it(finished: Run, tmp_path: Path) -> None:
    save_problem(falling(), tmp_path / "p.npz")
    for given in (tmp_path / "p.npz", str(tmp_path / "p.npz")):
        made = run(given, "SORprox", results=tmp_path, run_id=type(given).__name__, tolerances=1e-4, passes=1)
        assert made.cases["digest"].tolist() == finished.cases["digest"].tolist()
        assert made.cases["problem"].tolist() == ["mine"]


@pytest.mark.weekly
def test_a_run_stores_exactly_the_problems_that_the_package_lacks(tmp_path: Path) -> None:
    mine, same = falling(), falling("other name")
    made = run([mine, same, "hard-no-motion", "funnel-30"], "SORprox", results=tmp_path, tolerances=1e-1, passes=1)
    assert [file.name for file in (made.folder / "problems").iterdir()] == [f"{mine.digest}.npz"]
    assert made.info.carried == {"mine": mine.digest, "other name": mine.digest}
    for name in ("mine", "other name", "hard-no-motion"):
        problem = made.problem(name)
        assert problem.name == name
        assert problem.digest == made.cases.set_index("problem").loc[name, "digest"]
    with pytest.raises(ProblemError, match="the run has no problem 'mime'; did you mean 'mine'"):
        made.problem("mime")


@pytest.mark.slow
def test_resuming_a_finished_run_changes_nothing(tmp_path: Path) -> None:
    made = run("hard-groove", ["NSGS", "SORprox"], results=tmp_path, run_id="one", tolerances=1e-2, passes=1)
    before = {file: file.read_bytes() for file in made.folder.rglob("*.json")}
    assert resume(made).is_finished
    assert {file: file.read_bytes() for file in made.folder.rglob("*.json")} == before


@pytest.mark.weekly
def test_a_run_is_resumed_from_the_problems_that_it_stores(finished: Run, tmp_path: Path) -> None:
    made = run([falling(), falling("heavy", 2.0)], ["SORprox", "Jprox"], results=tmp_path, tolerances=1e-4, passes=1)
    lost = sorted((made.folder / "cases").iterdir())[::2]
    for file in lost:
        file.unlink()
    assert not load(made).is_finished
    again = load(made).resume()
    assert again.is_finished
    assert again.points["residual"].tolist() == made.points["residual"].tolist()
    assert [bool(session.finished) for session in again.info.sessions] == [True, True]


@pytest.mark.slow
def test_a_run_is_resumed_without_the_plugin_of_its_problem(tmp_path: Path) -> None:
    plugin = tmp_path / "points.py"
    plugin.write_text(
        "import numpy as np\nfrom proxbench.problems import ContactProblem\n"
        "def point():\n    return ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3)\n"
        "PROBLEMS = {'plugged': point}\n"
    )
    made = run("plugged", "SORprox", results=tmp_path, tolerances=1e-4, passes=1, plugins=plugin)
    assert [(use.kind, use.name, use.file) for use in made.info.plugins] == [("problem", "plugged", str(plugin))]
    for file, _ in registered():
        forget(file)
    plugin.unlink()
    next((made.folder / "cases").iterdir()).unlink()
    again = resume(made)
    assert again.cases["digest"].tolist() == made.cases["digest"].tolist()
    assert again.problem("plugged").provenance["plugin"] == f"plugin file {plugin}"


@pytest.mark.weekly
def test_a_generated_problem_is_carried_whether_it_was_there_before_or_is_made_for_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "cache"
    monkeypatch.setenv("PROXBENCH_CACHE", str(cache))
    monkeypatch.setitem(SUITES, "all", [*SUITES["all"], "late"])
    monkeypatch.setattr(
        "proxbench.bench.measure.execution.run_executor.generate",
        lambda names: [save_problem(falling(name, 2.0), cache / f"{name}.npz") for name in names],
    )
    save_problem(falling("early"), cache / "early.npz")
    made = run(["early", "late"], "SORprox", results=tmp_path / "results", tolerances=1e-1, passes=1)
    assert made.info.carried == {"early": falling().digest, "late": falling(weight=2.0).digest}
    shutil.rmtree(cache)
    assert made.problem("late").digest == made.info.carried["late"]


@pytest.mark.slow
def test_a_carried_problem_that_is_damaged_stops_the_run_by_name(tmp_path: Path) -> None:
    made = run(falling(), "SORprox", results=tmp_path, tolerances=1e-1, passes=1)
    (file,) = (made.folder / "problems").iterdir()
    file.write_bytes(file.read_bytes()[:-30])
    with pytest.raises(ProblemError, match=f"{file.name} is damaged"):
        resume(made)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hard-no-motion", "funnel-30"])
def test_a_problem_that_differs_from_the_library_problem_of_its_name_is_refused(name: str, tmp_path: Path) -> None:
    assert name in SUITES["all"]
    with pytest.raises(BenchError, match=f"the problem '{name}' differs from the problem of that name"):
        run(falling(name), "SORprox", results=tmp_path)
    assert list(tmp_path.iterdir()) == []
    made = run(load_problem(name).fresh(), "SORprox", results=tmp_path, tolerances=1e-1, passes=1)
    assert made.info.carried == {}


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_report_writes_what_it_names(finished: Run) -> None:
    made = finished.report()
    assert made.results["outcome"].tolist() == [Outcome.SOLVED]
    assert made.summary["solver"].tolist() == ["SORprox"]
    assert {file.parent.name for file in made.tables} == {"tables"}
    assert {file.parent.name for file in made.charts} == {"charts"}
    assert all(file.stat().st_size for file in (*made.tables, *made.charts))
    assert finished.report(charts=False).charts == []


class Texts(HTMLParser):
    """Collect the tags and texts of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.texts: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.texts.append(data.strip())


def test_a_notebook_shows_the_summary_and_no_markup_of_names(finished: Run) -> None:
    hostile = "<script>alert(1)</script>"
    plan = replace(finished.info.plan, solvers=[hostile])
    info = replace(finished.info, run_id=hostile, plan=plan, sessions=[])
    cases = finished.cases.assign(solver=hostile)
    points = finished.points.assign(solver=hostile, is_excluded=False)  # no warnings on a busy machine
    rounds = finished.rounds.assign(excluded="", probe_seconds=1e-6)
    quiet = dataclasses.replace(finished, info=info, cases=cases, points=points, rounds=rounds)
    page = Texts(quiet._repr_html_())
    assert page.tags == {"h4", "p", "table", "thead", "tbody", "tr", "th", "td"}
    assert hostile in page.texts
    assert {"confirmed 1e-04", "1/1"} <= set(page.texts)
    assert len("".join(page.texts)) < 4000


def test_bench_shows_the_names_that_it_exports() -> None:
    assert dir(bench) == sorted(bench.__all__)
    assert set(bench.__all__) == {
        "Run",
        "bundle",
        "compare",
        "load",
        "merge",
        "plot_convergence",
        "rejudge",
        "resume",
        "run",
        "study",
    }
