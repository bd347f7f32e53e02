"""A solver of a plugin may be a part of another solver, which then runs where plugins may run."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.plugins.files import plugin_uses, use_plugin_files
from proxbench.bench.plugins.remote_solver import open_solver
from proxbench.bench.plugins.solver_specs import SolverSpec
from proxbench.problems import PluginError, load
from proxbench.problems.exchange.plugins.offers import forget, registered
from proxbench.solvers import Status, Stop, create

PART = """
from proxbench.solvers import Model, create

class Part:
    name, model = "Part", Model.COULOMB

    def supports(self, problem):
        return None

    def prepare(self, problem):
        return create("NSGS").prepare(problem)

SOLVERS = [Part]
"""


@pytest.fixture
def composed(tmp_path: Path) -> Iterator[SolverSpec]:
    path = tmp_path / "part.py"
    path.write_text(PART)
    use_plugin_files([path])
    yield solver_spec("Fallback(SORprox, Part)")
    for file, _ in registered():
        forget(file)


def test_composite_with_a_plugin_part_runs_in_a_plugin_process(composed: SolverSpec) -> None:
    assert composed.name == "Fallback(SORprox, Part)"
    assert not composed.is_built_in
    assert plugin_uses([composed.name], [])[0].name == "Part"
    with open_solver(composed) as solver:
        solution = solver.prepare(load("hard-counterexample")).solve(Stop(1e-12))
    assert solution.status is Status.SOLVED
    assert solution.message.endswith("Part from zero: solved")


def test_composite_with_a_plugin_part_needs_a_plugin_process(composed: SolverSpec) -> None:
    with pytest.raises(PluginError):
        create(composed.name)
