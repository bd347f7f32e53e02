"""Names create solvers and their parts, and solvers have the same names."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Model, ProblemError, load, save_problem
from proxbench.solvers import Solver, SolverError, Status, Stop, available, create, solve
from proxbench.solvers.registry import compiled_solvers, composites, find_offer, parts, plain_names

NESTED = "Fallback(SORprox(relaxation=1.5), Fallback(NSGS, SemismoothNewton, iterations=10), warm_iterations=7)"


@pytest.mark.parametrize(
    "name", ["Refined(ClarabelCoulomb)", "Refined(CvxpyCoulomb(solver='SCS'))", "Fallback(NSGS)", NESTED]
)
def test_a_name_with_parts_creates_the_solver_of_that_name(name: str) -> None:
    solver = create(name)
    assert isinstance(solver, Solver)
    assert solver.name == name
    assert create(solver.name) == solver


def test_options_may_be_keyword_arguments() -> None:
    assert create("Fallback(SORprox, NSGS)", iterations=100).name == "Fallback(SORprox, NSGS, iterations=100)"


def test_examples_of_composites_can_be_created_and_are_not_available_names() -> None:
    for name, example in composites().items():
        assert create(example).name == example
        assert name not in available()


def test_plain_names_lists_the_solver_and_its_parts() -> None:
    assert plain_names(NESTED) == ["Fallback", "SORprox", "Fallback", "NSGS", "SemismoothNewton"]
    assert find_offer(NESTED) is None


def test_solvers_with_kernels_are_those_among_the_parts_of_a_name() -> None:
    assert compiled_solvers(NESTED) == ["SORprox", "NSGS", "SemismoothNewton"]
    assert compiled_solvers("Executable(./NSGS)") == compiled_solvers("PinocchioADMM") == []
    assert set(available()) - set(compiled_solvers()) == {"CvxpyCoulomb", *parts()}


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Fallback", r"name them as in Fallback\(SORprox, NSGS\)"),
        ("Refined", r"name them as in Refined\(ClarabelCoulomb\)"),
        ("Refined(ClarabelCoulomb, CvxpyCoulomb)", "name them as in"),
        ("SORprox(NSGS)", "SORprox has no parts"),
        ("Fallback(SORporx)", "did you mean 'SORprox'"),
        ("Fallbak(SORprox)", "did you mean 'Fallback'"),
        ("Fallback(SORprox, iteration=3)", "did you mean 'iterations'"),
        ("Fallback(SORprox(relaxtion=1.2))", "did you mean 'relaxation'"),
        ("Fallback(SORprox, 3)", "cannot read"),
    ],
)
def test_an_invalid_name_is_refused_with_the_reason(name: str, reason: str) -> None:
    with pytest.raises(SolverError, match=reason):
        create(name)


def test_solve_accepts_the_name_and_the_file_of_a_problem(tmp_path: Path) -> None:
    problem = load("hard-groove")
    save_problem(problem, tmp_path / "groove.npz")
    expected = solve(problem).impulses
    for given in ("hard-groove", tmp_path / "groove.npz", str(tmp_path / "groove.npz")):
        np.testing.assert_array_equal(solve(given).impulses, expected)


def test_solve_refuses_unknown_arguments_and_shows_how_to_pass_a_start() -> None:
    with pytest.raises(SolverError, match="solve has no argument `foo`; it takes max_iterations and max_seconds"):
        solve("funnel-30", foo=1)
    with pytest.raises(
        SolverError, match=r"no argument `start`.*create\(solver\).prepare\(problem\).solve\(stop, start"
    ):
        solve("funnel-30", start=None)


@pytest.mark.parametrize("limits", [{"tolerance": "1e-3"}, {"max_iterations": "many"}, {"max_seconds": None}])
def test_a_limit_that_is_no_number_is_shown(limits: dict[str, Any]) -> None:
    with pytest.raises(SolverError, match="`tolerance`, `max_iterations` and `max_seconds` must be numbers, got "):
        Stop(**limits)


def test_anything_but_a_problem_is_refused() -> None:
    with pytest.raises(SolverError, match="problem must be a ContactProblem, a name or a path, not ndarray"):
        solve(np.eye(3))  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="there is no problem 'funel-30'; did you mean 'funnel-30'"):
        solve("funel-30")


class Faulty:
    """A solver that does not implement one method of the interface."""

    name, model = "Faulty", Model.COULOMB

    def __init__(self, fault: str) -> None:
        self.fault = fault

    def supports(self, problem: ContactProblem) -> Any:
        return True if self.fault == "supports" else None

    def prepare(self, problem: ContactProblem) -> Any:
        return None if self.fault == "prepare" else self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Any:
        return np.zeros(3)


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        (
            Faulty("supports"),
            "Faulty does not implement the solver interface: its supports returned True; return",
        ),
        (Faulty("prepare"), "its prepare returned a NoneType, which has no method solve"),
        (Faulty("solve"), "its solve returned ndarray, not a Solution"),
        (Faulty, r"the solver Faulty is a class; pass an instance, Faulty\(\)"),
        (5, "the solver int does not implement the solver interface: it has no name"),
    ],
)
def test_solver_without_the_interface_is_refused_with_the_fault(solver: Any, words: str) -> None:
    with pytest.raises(SolverError, match=words):
        solve("hard-no-motion", solver)


def test_impulses_of_an_unsupported_problem_are_positive_zeros() -> None:
    solution = solve(ContactProblem.from_delassus(np.eye(3), [-1.0, -2.0, 0.0], 0.5), "Enumeration")
    assert solution.status is Status.UNSUPPORTED
    assert not np.signbit(solution.impulses).any()
