"""Generation is deterministic, and reproduces the library."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench.simulation.generation.generate import (
    RollingRecipe,
    generate,
    generate_missing,
    recipes,
    remake_problems,
)
from proxbench.problems import ContactProblem, ProblemError, load
from proxbench.problems.exchange.catalog import SUITES
from proxbench.problems.hard import HARD_CASES
from proxbench.problems.hard.spheres import with_rolling_friction

SMALL = ["funnel-30-early", "funnel-30", "woodpecker-beak-impact", "bodies-train-10", "bodies-chain-20"]


def difference(first: ContactProblem, second: ContactProblem) -> float:
    """Largest difference of c and W, relative to the largest entry."""
    assert first.factors is not None
    assert second.factors is not None
    pairs = [
        (first.free_velocity, second.free_velocity),
        (first.factors.force_directions.toarray(), second.factors.force_directions.toarray()),
    ]
    assert all(a.shape == b.shape for a, b in pairs)
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)


def test_every_problem_that_is_not_a_formula_has_a_recipe() -> None:
    assert set(recipes()) == set(SUITES["all"]) - set(HARD_CASES)


def test_rolling_pile_is_the_frozen_pile_with_rolling_friction_added() -> None:
    recipe = recipes()["pile-100-rolling"]
    assert isinstance(recipe, RollingRecipe)
    resisting = with_rolling_friction(load(recipe.problem), recipe.rolling_friction)
    assert load("pile-100-rolling").digest == resisting.digest


def test_a_recipe_that_adds_a_law_remakes_what_it_is_added_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(recipes(), "rolling", RollingRecipe("funnel-30-early", 0.002))
    plain, resisting = remake_problems(["funnel-30-early"]), remake_problems(["rolling"])
    for one, other in zip(plain, resisting, strict=True):
        assert (other.name, other.provenance["rolling_friction"]) == ("rolling", 0.002)
        assert other.digest == with_rolling_friction(one, 0.002).digest


@pytest.mark.slow
def test_remade_problems_match_the_frozen_ones_to_solver_accuracy() -> None:
    """Steps are solved to 1e-12; impacts amplify the rounding of another machine or solver, but not beyond 1e-6 yet."""
    for problem in remake_problems(SMALL):
        assert difference(problem, load(problem.name)) <= 1e-6


@pytest.mark.weekly
def test_two_fresh_processes_generate_equal_digests(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from proxbench.bench.cli.main import main; main()", "generate", *SMALL, "--json"]
    digests = []
    for folder in ("a", "b"):
        environment = {**os.environ, "PROXBENCH_CACHE": str(tmp_path / folder)}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        files = json.loads(done.stdout)
        assert sorted(Path(file).name for file in files) == sorted(f"{name}.npz" for name in SMALL)
        digests.append(list(files.values()))
    assert digests[0] == digests[1]


@pytest.mark.slow
def test_problems_of_one_simulation_are_captured_at_their_own_steps(tmp_path: Path) -> None:
    files = generate(SMALL[:2], tmp_path)
    assert [file.name for file in files] == ["funnel-30-early.npz", "funnel-30.npz"]
    early, dense = remake_problems(SMALL[:2])
    assert early.provenance["step"] < dense.provenance["step"]  # type: ignore[operator]


def test_only_problems_that_are_missing_are_generated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path))
    generate_missing(["hard-groove", "funnel-30", "bodies-arch-7-thin", "unknown"])
    assert [file.name for file in tmp_path.iterdir()] == ["bodies-arch-7-thin.npz"]
    assert load("bodies-arch-7-thin").n_contacts == 32
    (tmp_path / "bodies-arch-7-thin.npz").write_bytes(b"kept")
    generate_missing(["bodies-arch-7-thin"])
    assert (tmp_path / "bodies-arch-7-thin.npz").read_bytes() == b"kept"


@pytest.mark.parametrize(("name", "words"), [("hard-groove", "nothing to generate"), ("funel-30", "'funnel-30'")])
def test_names_without_a_recipe_are_refused(name: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=words):
        generate([name], tmp_path)
    assert list(tmp_path.iterdir()) == []
