"""The judge gives no impulses a certificate that exact arithmetic refutes."""

import numpy as np
import pytest
from adversary import search
from exact_residual import exact_residual
from proxbench.problems import ContactProblem, judge, load


@pytest.mark.slow
@pytest.mark.parametrize(("count", "seed"), [(400, 0), pytest.param(3000, 1, marks=pytest.mark.weekly)])
def test_adversarial_impulses_get_no_wrong_certificate(count: int, seed: int) -> None:
    found = search(count, seed)
    assert found.certificates.total() > count / 15
    assert found.wrong == []


def test_the_exact_residual_is_the_judged_one_where_rounding_is_small() -> None:
    rng = np.random.default_rng(0)
    for name in ("hard-mixed-laws", "hard-linked-2-axes", "hard-tower-3", "woodpecker-beak-impact"):
        problem = load(name)
        impulses = rng.normal(size=problem.n_rows)
        assert float(exact_residual(problem, impulses)) == pytest.approx(judge(problem, impulses).residual, rel=1e-13)


def test_the_exact_residual_of_a_squeezed_body_is_one() -> None:
    assert exact_residual(load("hard-squeezed"), np.array([1e16, 1e16])) == 1
    problem = ContactProblem.from_delassus(np.eye(1), [-1.0], dim=1)
    assert exact_residual(problem, np.ones(1)) == 0
