"""Studies small enough for a test."""

from typing import Any

import pytest
from proxbench.bench.study.plan import FIXED, REFERENCE, Case, StudyPlan
from proxbench.problems.scenes.woodpecker import PERIOD


def toy_case(**changes: Any) -> Case:
    """A case of the woodpecker with variable steps."""
    stepper = "Extrapolated(tolerance=1e-4, min_step=1e-6)"
    values: dict[str, Any] = {
        "part": "steppers",
        "series": "Extrapolated",
        "stepper": stepper,
        "step_size": None,
        "solver": "SORprox",
        "tolerance": 1e-12,
        "max_iterations": 20_000,
        "members": (1.0,),
    }
    return Case(**{**values, **changes})


def fixed_case(steps: int, **changes: Any) -> Case:
    """A case of the woodpecker with so many steps a period."""
    values = {"series": "fixed", "stepper": FIXED, "step_size": PERIOD / steps, "tolerance": 1e-10}
    return toy_case(**{**values, **changes})


def toy_plan(*cases: Case, duration: float = PERIOD) -> StudyPlan:
    """A study of the woodpecker."""
    return StudyPlan("woodpecker", {"start": "cycle"}, duration, cases)


def pour_case(size: float, part: str = "steppers", seeds: tuple[float, ...] = (0, 1)) -> Case:
    """A case of a pour with fixed steps."""
    return Case(part, "over Δt", FIXED, size, "SORprox", 1e-4, 5000, seeds)


@pytest.fixture
def pour_plan() -> StudyPlan:
    """A study of thirty balls."""
    cases = (pour_case(2e-3, REFERENCE), pour_case(8e-3), pour_case(4e-3))
    return StudyPlan("funnel", {"balls": 30, "outlet": 3.0}, 0.3, cases)
