"""The examples in C and Rust are SORprox in another language: equal iterates, statuses and counts."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from native_builds import EXAMPLES, build_in_c
from proxbench.bench.conformance.solver_checks import SOLVER_CHECKS
from proxbench.problems import judge, load
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.solver import Solver, Status, Stop
from proxbench.solvers import create

PROBLEMS = (
    "hard-stack-10",
    "hard-sliding-block",
    "hard-mixed-laws",
    "hard-remote-partner",
    "hard-tresca-joint",
    "hard-four-bar-redundant",
    "hard-resisting-sphere-steep",
    "hard-linked-2-axes",
    "woodpecker-beak-impact",
    "funnel-30",
)
LANGUAGES = ("c_library", "rust_library", "program")


@pytest.fixture(params=LANGUAGES)
def text(request: pytest.FixtureRequest) -> str:
    """The name of the example in one language."""
    file: Path = request.getfixturevalue(request.param)
    return f"{'Executable' if request.param == 'program' else 'Shared'}({file})"


def iterates(solver: Solver, name: str) -> list[FloatArray]:
    shown: list[FloatArray] = []
    limits = Stop(1e-9, max_iterations=40)
    solver.prepare(load(name)).solve(limits, observe=lambda iteration, impulses: shown.append(impulses.copy()))
    return shown


@pytest.mark.parametrize("name", PROBLEMS)
def test_native_sweeps_equal_built_in_sweeps_to_rounding(text: str, name: str) -> None:
    ours, theirs = iterates(create("SORprox"), name), iterates(create(text), name)
    assert len(ours) == len(theirs) > 0
    for one, other in zip(ours, theirs, strict=True):
        assert np.abs(one - other).max() <= 1e-14 * np.abs(one).max()


@pytest.mark.parametrize("name", PROBLEMS)
def test_native_sweeps_have_the_status_and_iterations_of_sorprox(text: str, name: str) -> None:
    problem, limits = load(name), Stop(1e-6, max_iterations=2000)
    ours = create("SORprox", relaxation=1.2).prepare(problem).solve(limits)
    theirs = create(text[:-1] + ", options='relaxation=1.2')").prepare(problem).solve(limits)
    assert (theirs.status, theirs.iterations) == (ours.status, ours.iterations)
    if theirs.status is Status.SOLVED:
        assert judge(problem, theirs.impulses).residual <= 1e-6


def test_an_unreadable_option_is_refused_with_a_sentence(text: str) -> None:
    solver = create(text[:-1] + ", options='relaxation=-1')")
    solution = solver.prepare(load("hard-stack-10")).solve(Stop())
    assert solution.status is Status.UNSUPPORTED
    assert "a positive number" in solution.message


def checks_of_languages() -> list[Any]:
    """Return each language with each check; slow tests run each check in one language."""
    pairs = product(enumerate(LANGUAGES), enumerate(SOLVER_CHECKS))
    return [
        pytest.param(language, check, marks=[] if column % len(LANGUAGES) == row else pytest.mark.weekly)
        for (row, language), (column, check) in pairs
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "check"), checks_of_languages(), indirect=["text"], ids=str)
def test_it_passes_the_conformance_test(text: str, check: object) -> None:
    check.run(create(text))  # type: ignore[attr-defined]


def test_the_library_of_the_guide_sweeps_over_frictionless_contacts(tmp_path: Path) -> None:
    guide = (EXAMPLES.parent / "how-to" / "solver-in-c.md").read_text(encoding="utf-8")
    (tmp_path / "guide.c").write_text(guide.partition("```c\n")[2].partition("```")[0])
    library = build_in_c(tmp_path / "guide.so", tmp_path / "guide.c", options=("-Wno-unused-parameter",))
    problem = load("hard-stack-10")
    solution = create(f"Shared({library})").prepare(problem).solve(Stop(max_iterations=3000))
    assert judge(problem, solution.impulses).residual <= 1e-6
