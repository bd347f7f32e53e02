"""The example plugins of the documentation run with ``--plugin``, and their methods solve contact problems."""

import importlib.util
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.problems import ContactProblem, Laws, Model, judge, load
from proxbench.problems.exchange.plugins.files import PluginFile
from proxbench.problems.exchange.plugins.offers import forget
from proxbench.solvers import Solver, Status, Stop, solve
from proxbench.solvers.sweeps.cone import ConeProblem

FOLDER = Path(__file__).parents[2] / "docs" / "plugins"
PLUGINS = {"FBF": FOLDER / "fbf.py", "TrescaFixedPoint": FOLDER / "tresca_fixed_point.py"}


@cache
def module_of(name: str) -> Any:
    """Return the module of a plugin, whose kernels are compiled once."""
    spec = importlib.util.spec_from_file_location(PLUGINS[name].stem, PLUGINS[name])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def solver_of(name: str) -> Solver:
    (factory,) = module_of(name).SOLVERS
    solver: Solver = factory()
    return solver


def test_every_plugin_of_the_folder_is_tested() -> None:
    assert set(PLUGINS.values()) == set(FOLDER.glob("*.py"))


@pytest.mark.weekly
@pytest.mark.parametrize("name", ["FBF", "TrescaFixedPoint"])
def test_a_run_measures_the_plugin(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["run", "--plugin", str(PLUGINS[name]), "--solver", name, "--problem", "hard-sticking-box"]
    try:
        assert run_command([*command, "--tolerance", "1e-3"]) == 0
    finally:
        forget(PluginFile.read(PLUGINS[name]))
    assert name in capsys.readouterr().out


@pytest.mark.weekly
@pytest.mark.parametrize("name", PLUGINS)
def test_the_plugin_passes_the_conformance_tests(name: str) -> None:
    if name == "FBF" and os.environ.get("PROXBENCH_PROFILE") != "full":
        pytest.skip("takes a minute; PROXBENCH_PROFILE=full runs it")
    assert run_command(["check", str(PLUGINS[name])]) == 0


@pytest.mark.parametrize("name", PLUGINS)
def test_a_sliding_point_is_braked_by_mu_times_its_normal_impulse(name: str) -> None:
    """A point of 2 kg slides at 1 m/s on the ground, and a normal impulse of 0.5 N s presses it down."""
    problem = ContactProblem.from_factors(np.eye(3), np.full(3, 0.5), [-0.25, 0.6, -0.8], 0.3)
    solution = solve(problem, solver_of(name), tolerance=1e-9)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([0.5, -0.3 * 0.5 * 0.6, 0.3 * 0.5 * 0.8], abs=1e-8)


@pytest.mark.parametrize("name", PLUGINS)
def test_the_plugin_reaches_the_velocities_of_sweeps_on_a_flow(name: str) -> None:
    problem = load("funnel-30-early")
    solution, swept = (solve(problem, each, tolerance=1e-9) for each in (solver_of(name), "NSGS"))
    assert solution.status is Status.SOLVED
    difference = problem.relative_velocity(solution.impulses) - problem.relative_velocity(swept.impulses)
    assert np.abs(difference).max() <= 1e-6 * np.abs(problem.free_velocity).max()


def test_fbf_declines_friction_that_another_contact_bounds() -> None:
    laws = Laws.in_order([0, 0, 1], np.array([0.0, 0.0, 0.5]), np.zeros(3), np.array([-1, -1, 0]))
    problem = ContactProblem.from_delassus(np.eye(3), [-1.0, -1.0, 0.2], laws=laws)
    assert "has no friction cone" in str(solver_of("FBF").supports(problem))


def test_cone_sweeps_reach_the_minimum_of_the_convex_model() -> None:
    problem = load("funnel-30-early")
    cone = ConeProblem.of(problem)
    x = module_of("FBF").ConeSweep(cone).run(5000, np.zeros(problem.n_rows), cone.free, 0.0)
    assert judge(problem, cone.size * x, Model.CONVEX).residual <= 1e-8


@pytest.mark.parametrize("name", PLUGINS)
def test_an_iteration_limit_holds(name: str) -> None:
    problem = load("funnel-30")
    solution = solver_of(name).prepare(problem).solve(Stop(1e-12, 7))
    assert (solution.status, solution.iterations) == (Status.ITERATION_LIMIT, 7)
