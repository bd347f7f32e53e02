"""The stored index of problems agrees with the problems."""

import pytest
from proxbench.problems import ContactProblem
from proxbench.problems.exchange import index
from proxbench.problems.exchange.catalog import SUITES, is_shipped, load
from proxbench.problems.exchange.index import current_summaries, stored_summaries


def test_every_standard_problem_that_is_held_loads_and_agrees_with_the_index(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a change of the library run ``python -m proxbench.problems.exchange.index``."""
    names: list[str] = []

    def loaded(name: str) -> ContactProblem:
        problem = load(name)
        names.append(problem.name)
        return problem

    monkeypatch.setattr(index, "load", loaded)
    assert dict(stored_summaries()) == current_summaries()
    assert names == [name for name in SUITES["all"] if is_shipped(name)]


def test_the_index_has_every_standard_problem_that_is_held() -> None:
    assert set(stored_summaries()) == {name for name in SUITES["all"] if is_shipped(name)}
