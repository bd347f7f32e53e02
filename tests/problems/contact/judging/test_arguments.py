"""The judge refuses invalid problems and impulses, with the remedy."""

import numpy as np
import pytest
from proxbench.problems import ProblemError, judge, load
from proxbench.solvers import solve


def test_a_solution_or_a_name_in_the_place_of_impulses_or_a_problem_is_refused_with_the_remedy() -> None:
    problem = load("funnel-30")
    with pytest.raises(ProblemError, match=r"pass solution\.impulses"):
        judge(problem, solve(problem))  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="judge takes a ContactProblem, not str; read one with load"):
        judge("funnel-30", np.zeros(3))  # type: ignore[arg-type]
