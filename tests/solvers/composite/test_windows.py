"""Windows: slow sweeps end after the work of a fixed number of interior point steps at the latest."""

import math

import pytest
from proxbench.problems import load
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Stop, create
from proxbench.solvers.composite import robust
from proxbench.solvers.composite.interior_newton import first_method
from proxbench.solvers.composite.sequence import SolverSequence
from proxbench.solvers.composite.windows import SHORT_WINDOW, WINDOW, Window, longest_window, window_lengths
from proxbench.solvers.composite.work import MAX_STEPS, step_seconds, sweep_seconds
from proxbench.solvers.iteration.stopping import Clock


def sequence_on(name: str) -> SolverSequence:
    """Return a sequence before its first solver."""
    problem = load(name)
    return SolverSequence(problem, Residual(problem), {}, Stop(1e-8), None, Clock(math.inf))


def test_sweeps_are_slow_if_a_window_gains_less_than_a_digit() -> None:
    window = Window(100)
    assert not window.is_slow(0, 1.0)
    assert not window.is_slow(99, 0.5)
    assert not window.is_slow(100, 0.09)
    assert not window.is_slow(199, 0.09)
    assert window.is_slow(200, 0.01)


def test_a_new_window_begins_when_a_digit_is_gained() -> None:
    """Digits of the first sweeps, which are fast on every problem, do not count for later ones."""
    window = Window(100)
    residuals = {0: 1.0, 10: 0.1, 20: 0.01}
    lost = [sweep for sweep in range(0, 201, 10) if window.is_slow(sweep, residuals.get(sweep, 0.009))]
    assert lost[0] == 120


def test_the_length_is_limited_after_slow_sweeps_even_if_a_digit_was_gained_before() -> None:
    window = Window(5000, 0, lambda: 600)
    lost = [sweep for sweep in range(0, 5001, 10) if window.is_slow(sweep, 1.0 if sweep < 300 else 0.05)]
    assert lost[0] == 300 + 600


@pytest.mark.parametrize(("longest", "end"), [(0, WINDOW), (600, 600), (5000, 1000)])
def test_a_slow_window_is_shortened_once_and_not_below_its_constant_part(longest: int, end: int) -> None:
    calls: list[int] = []

    def limit() -> int:
        calls.append(longest)
        return longest

    window = Window(1000, 7, limit)
    lost = [sweep for sweep in range(0, 1001, 10) if window.is_slow(7 + sweep, 0.5)]
    assert lost[0] == end
    assert calls == [longest]


def test_windows_that_gain_a_digit_are_not_measured() -> None:
    """The limit requires a prepared interior point method; fast sweeps must not spend time on this preparation."""
    window = Window(1000, 0, lambda: pytest.fail("the limit was computed"))
    assert not any(window.is_slow(sweep, 10.0 ** (-sweep / 300)) for sweep in range(0, 5000, 10))


def test_a_window_takes_the_work_of_a_fixed_number_of_steps() -> None:
    """Rolling friction makes sweeps slow; the window is the work of ``MAX_STEPS`` steps over that of a sweep."""
    sequence = sequence_on("pile-100-rolling")
    problem, longest = sequence.problem, longest_window(sequence)
    work = MAX_STEPS * step_seconds(problem, first_method(problem).prepare(problem).system.flops)
    assert longest * sweep_seconds(problem) <= work < (longest + 1) * sweep_seconds(problem)
    assert longest < window_lengths(problem)[-1]


@pytest.mark.parametrize("name", ["pile-100", "pile-400-mixed-1", "funnel-planar-1000", "hard-chain-100"])
def test_nothing_is_prepared_if_the_limit_exceeds_all_windows(name: str) -> None:
    """A step takes at least 0.3 ms + 5 µs per row; ``MAX_STEPS`` steps of this time exceed the windows here."""
    sequence = sequence_on(name)
    assert longest_window(sequence) >= window_lengths(sequence.problem)[-1]
    assert not sequence.prepared


@pytest.mark.parametrize(
    ("name", "has_short"), [("pile-100", False), ("hard-chain-100", True), ("hard-stack-10", True)]
)
def test_few_rows_and_joints_have_a_short_window_first(name: str, has_short: bool) -> None:
    assert (SHORT_WINDOW in window_lengths(load(name))) is has_short


def test_the_limit_shortens_the_sweeps_of_a_solve(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps on ``pile-100`` gain few digits; a whole window exceeds the limit of a solve, a short one does not."""
    problem = load("pile-100")
    limits = Stop(1e-8, max_iterations=window_lengths(problem)[-1])
    whole = create("Robust").prepare(problem).solve(limits)
    monkeypatch.setattr(robust, "longest_window", lambda _: 0)
    shortened = create("Robust").prepare(problem).solve(limits)
    assert ": slow; AndersonSORprox" not in whole.message
    assert ": slow; AndersonSORprox" in shortened.message
