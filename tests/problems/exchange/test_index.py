"""The stored index of problems agrees with the problems."""

from proxbench.problems.exchange.catalog import SUITES, is_shipped
from proxbench.problems.exchange.index import current_summaries, stored_summaries


def test_the_index_agrees_with_every_problem_the_package_holds() -> None:
    """After a change of the library run ``python -m proxbench.problems.exchange.index``."""
    assert dict(stored_summaries()) == current_summaries()


def test_the_index_has_every_standard_problem_that_is_held() -> None:
    assert set(stored_summaries()) == {name for name in SUITES["all"] if is_shipped(name)}
