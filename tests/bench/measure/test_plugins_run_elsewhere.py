"""No command runs code of a plugin in the process that judges."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.problems.exchange.plugins.offers import forget, registered

pytestmark = pytest.mark.slow

PLUGIN = """
import os
from dataclasses import dataclass
import numpy as np
from proxbench.problems import ContactProblem, Model
from proxbench.solvers import create, name_with_options

def note():
    with open({log!r}, "a") as file:
        print(os.getpid(), file=file)

note()

@dataclass(frozen=True)
class Noted:
    model = Model.COULOMB
    name = property(name_with_options)

    def __post_init__(self): note()
    def supports(self, problem): note()

    def prepare(self, problem):
        note()
        return create("SORprox").prepare(problem)

def noted():
    note()
    return ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3)

SOLVERS = [Noted]
PROBLEMS = {{"noted": noted}}
"""


@pytest.fixture(autouse=True)
def nothing_registered() -> Iterator[None]:
    """Unregister the plugins of a test."""
    yield
    for file, _ in registered():
        forget(file)


@pytest.mark.parametrize(
    "line",
    [
        "list",
        "run --problem noted --solver Noted --tolerance 1e-3 --output {folder} --no-progress --no-charts --record",
        "generate noted --output {folder}",
        "record noted --solver Noted --output {folder}/noted.rrd",
        "matrix --problem noted --solver Noted",
        "simulate funnel(balls=20) --duration 0.05 --solver Noted --output {folder}/funnel.npz --no-progress",
        "simulate woodpecker --duration 0.002 --solver Noted --output {folder}/toy.npz --no-progress",
        pytest.param(
            "simulate pile(balls=3) --study --solver Noted --duration 0.02 --output {folder} --no-progress",
            marks=pytest.mark.weekly,
        ),
        pytest.param("check Noted", marks=pytest.mark.weekly),
        "check noted",
    ],
)
def test_a_command_runs_plugins_in_processes_of_their_own(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, plugin = tmp_path / "pids", tmp_path / "noting.py"
    plugin.write_text(PLUGIN.format(log=str(log)))
    assert run_command([*line.format(folder=tmp_path).split(), "--plugin", str(plugin)]) == 0
    pids = set(log.read_text().split())
    assert pids
    assert str(os.getpid()) not in pids
