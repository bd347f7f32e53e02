"""The commands that a page and the solver matrix show repeat their measurement with the same plan."""

import shlex
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import pytest
from proxbench.bench import load, runs
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.contacts import matrix
from proxbench.bench.measure.plan import make_plan
from proxbench.bench.plugins.files import plugin_uses, use_plugin_files
from proxbench.bench.report.page.commands import repeat_command
from proxbench.bench.store.plans import Limits, PlanRecord, RunSettings
from proxbench.bench.store.records import RunRecord
from proxbench.problems import ContactProblem, save_problem
from proxbench.problems.exchange.plugins.offers import forget, registered

REFERENCE = Path(__file__).parents[4] / "results/reference.bundle"

PLUGIN = """
from proxbench.solvers import create

class Renamed:
    name = "Renamed"

    def __init__(self):
        self._solver = create("NSGS")
        self.model = self._solver.model

    def supports(self, problem):
        return None

    def prepare(self, problem):
        return self._solver.prepare(problem)

SOLVERS = [Renamed]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder, with a folder of problems in two families, and a plugin."""
    monkeypatch.chdir(tmp_path)
    suite = tmp_path / "my problems" / "blocks"
    for family, count in (("light", 2), ("heavy", 6)):
        for index in range(count):
            (suite / family).mkdir(parents=True, exist_ok=True)
            problem = ContactProblem.from_delassus([[1.0 + index + 10.0 * count]], [-1.0], dim=1)
            save_problem(problem, suite / family / f"{family}-{index}.npz")
    (tmp_path / "my plugin.py").write_text(PLUGIN)
    yield tmp_path
    for file, _ in list(registered()):
        if file.path.is_relative_to(tmp_path):
            forget(file)


@cache
def reference_info() -> RunRecord:
    return load(REFERENCE).info


def record_of(plan: PlanRecord, solvers: Sequence[str]) -> RunRecord:
    return msgspec.structs.replace(reference_info(), plan=plan, plugins=plugin_uses(solvers, plan.problems))


def planned_by(command: str, monkeypatch: pytest.MonkeyPatch) -> PlanRecord:
    """The plan of the run that a command starts."""
    plans = []

    def measure(plan: Any, *_: object) -> None:
        plans.append(plan.record)
        raise BenchError("planned.")

    monkeypatch.setattr(runs, "measure", measure)
    words = shlex.split(command.replace("\\\n", ""))
    assert words[0] == "proxbench"
    assert run_command(words[1:]) == 2
    (plan,) = plans
    return plan


@pytest.mark.slow
@pytest.mark.parametrize(
    "chosen",
    [
        {"suite": "quick"},
        {"suite": "quick", "sample": 3},
        {"suite": "hard", "sample": 5, "sampling": "even", "shard": "2/3"},
        {"suite": "my problems/blocks", "sample": 4, "sampling": "even"},
        {"suite": "my problems/blocks", "shard": "1/2"},
        {"problems": ["hard-slider-in-um-mg", "my problems/blocks/heavy/heavy-1.npz"]},
        {"problems": ["my problems/blocks"], "sample": 4, "sampling": "even"},
        {"suite": "sequences", "sample": 2},
    ],
    ids=str,
)
def test_the_command_of_a_run_makes_its_plan(
    chosen: dict[str, Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_plugin_files([folder / "my plugin.py"])
    solvers = None if chosen.get("suite") == "sequences" else ["NSGS", "PyramidPGS(sides=4)", "Renamed"]
    limits = Limits(solve_seconds=0.1234567, case_seconds=7.0, memory_bytes=2**29)
    settings = RunSettings.checked([1e-3, 1.2345678e-5], limits, passes=3, seed=11)
    plan = make_plan(chosen.pop("problems", None), solvers, settings, **chosen).record
    command = repeat_command(record_of(plan, plan.solvers))
    assert planned_by(command, monkeypatch) == plan


@pytest.mark.slow
def test_the_command_of_a_merged_run_names_its_problems(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    plan = make_plan(None, ["NSGS"], suite="quick", sample=3).record
    merged = msgspec.structs.replace(plan, requested=[], suite="")
    again = planned_by(repeat_command(record_of(merged, ["NSGS"])), monkeypatch)
    assert (again.problems, again.solvers) == (plan.problems, plan.solvers)


@pytest.mark.slow
def test_the_command_of_a_matrix_has_its_arguments(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = []

    def measured(problems: Sequence[Any], solvers: Sequence[str], stop: Any, on_cell: Any) -> list[Any]:
        calls.append(([getattr(problem, "name", problem) for problem in problems], solvers, stop))
        return []

    monkeypatch.setattr(matrix, "measure_matrix", measured)
    words = ["--suite", "my problems/blocks", "--sample", "4", "--sampling", "even", "--plugin", "my plugin.py"]
    words += ["--solver", "Renamed", "--solver", "SORprox(form='factors')", "--tolerance", "1.2345678e-5"]
    run_command(["matrix", *words, "--max-iterations", "77", "--solve-seconds", "0.5"])
    shown = capsys.readouterr().out.split("`proxbench ")[1].split("`")[0]
    run_command(shlex.split(shown))
    first, second = calls
    assert first == second
    assert first[1] == ["Renamed", "SORprox(form='factors')"]
    assert "--plugin 'my plugin.py'" in shown
