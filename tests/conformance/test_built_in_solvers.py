"""Every built-in solver keeps the promises that plugins are held to."""

import pytest
from proxbench.bench.conformance import SOLVER_CHECKS, Check, NotApplicable
from proxbench.solvers import Solver, create

VARIANTS = [
    "Jprox",
    "JORprox(relaxation=0.5)",
    "JORprox(step_size='row_sum')",
    "SORprox",
    "SORprox(relaxation=1.5, form='factors')",
    "SafeguardedSORprox",
    "NSGS",
    "SemismoothNewton",
    "ClarabelSOCP",
    "ClarabelSOCP(form='factors')",
    "ClarabelCoulomb",
    "CvxpySOCP",
    "CvxpyCoulomb",
    "CvxpyQP",
    "Lemke",
    "PyramidPGS",
    "Enumeration",
]


def test_the_variants_cover_every_built_in_solver() -> None:
    from proxbench.solvers.registry import _BUILT_IN

    assert {name.split("(")[0] for name in VARIANTS} == set(_BUILT_IN)


@pytest.mark.parametrize("check", SOLVER_CHECKS, ids=str)
@pytest.mark.parametrize("name", VARIANTS)
def test_it_conforms(name: str, check: Check[Solver]) -> None:
    try:
        check.run(create(name))
    except NotApplicable as reason:
        pytest.skip(str(reason))
