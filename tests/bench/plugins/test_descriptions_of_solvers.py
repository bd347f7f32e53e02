"""Each option of a built-in solver has a documented meaning."""

import inspect

import pytest
from proxbench.bench.plugins.documentation import documentation_of
from proxbench.solvers.registry import BUILT_IN, PARTS, factory

UNDOCUMENTED = {"parts", "warm_iterations", "iterations"}
"""Fields that a composite computes; they are no options."""


@pytest.mark.parametrize("name", [*BUILT_IN, *PARTS])
def test_a_solver_has_a_summary_and_a_meaning_of_each_option(name: str) -> None:
    summary, meanings = documentation_of(name)
    assert summary.endswith(".")
    options = {option.name for option in inspect.signature(factory(name)).parameters.values()} - UNDOCUMENTED
    assert options <= set(meanings)
    assert all(len(meaning) > 10 for meaning in meanings.values()), meanings
