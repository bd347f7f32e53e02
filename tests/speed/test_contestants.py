"""Every solver that the speed tests omit has a stated reason."""

import pytest
from contestants import EXCUSES, OPTIONS, SIZES, contestants, excuse, step_for
from proxbench.problems.contact.laws import LawKind
from proxbench.solvers import available, create
from proxbench.solvers.registry import composites


def test_every_registered_solver_takes_part() -> None:
    assert {entry.partition("(")[0] for entry in contestants()} == {*available(), *composites()}


def test_options_and_excuses_refer_to_registered_solvers_and_measured_sizes() -> None:
    assert set(OPTIONS) <= set(available())
    assert {name for name, _ in EXCUSES} <= set(available())
    assert {size for _, size in EXCUSES} <= set(SIZES)
    for name, entries in OPTIONS.items():
        assert all(create(entry).name.startswith(name) for entry in entries)


def test_excuse_applies_to_any_options_of_a_solver_but_only_to_its_size() -> None:
    assert excuse("CvxpyCoulomb(memory=3)", 1000) == EXCUSES["CvxpyCoulomb", 1000]
    assert excuse("CvxpyCoulomb", 300) is None


@pytest.mark.parametrize(
    ("entry", "problem", "reason"),
    [
        ("SORprox", "funnel-30", ""),
        ("CvxpyCoulomb(solver='OSQP')", "funnel-planar-30", "funnel-30: "),
        ("Enumeration", None, "funnel-30: it has spatial friction"),
    ],
)
def test_a_solver_gets_the_most_general_step_that_it_supports(entry: str, problem: str | None, reason: str) -> None:
    _, step, reasons = step_for(entry, 30)
    assert (step.name if step else None) == problem
    assert reason in reasons
    if problem == "funnel-30":
        assert step is not None
        assert (step.laws.kind == LawKind.SPATIAL_FRICTION).any()
