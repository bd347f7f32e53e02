"""Models have valid numbers of sides."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Model, ProblemError, judge


@pytest.mark.parametrize("sides", [2, 4.5, "8"])
def test_a_pyramid_has_a_whole_number_of_at_least_three_sides(sides: int) -> None:
    with pytest.raises(ProblemError, match="whole number of at least 3 sides"):
        Model.pyramid(sides)


def test_the_text_of_a_model_identifies_it() -> None:
    for model in (Model.COULOMB, Model.CONVEX, Model.ENGINE, Model.pyramid(3), Model.pyramid(np.int64(8))):
        assert Model.from_text(str(model)) == model


@pytest.mark.parametrize("model", ["convex", None, 3])
def test_the_judge_refuses_what_is_not_a_model(model: Model) -> None:
    problem = ContactProblem.from_delassus(np.eye(3), np.zeros(3))
    with pytest.raises(ProblemError, match="model must be a Model"):
        judge(problem, np.zeros(3), model)
