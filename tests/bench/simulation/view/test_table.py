"""The table aggregates steps by simulated time, and never hides an unsolved step."""

import io
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as changed
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import simulate
from proxbench.bench.simulation.simulation import Simulation
from proxbench.bench.simulation.step_row import step_columns
from proxbench.bench.simulation.view.live import LiveSummary
from proxbench.bench.simulation.view.table import print_simulation, simulation_document, summary, windows
from rich.console import Console

Pour = Callable[..., SimulationPlan]


def printed(simulation: Simulation, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width)
    print_simulation(simulation, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert isinstance(text, str)
    return text


def made(times: np.ndarray, tolerance: float = 1e-4, **columns: object) -> Simulation:
    """A simulation of the funnel whose steps end at ``times``, with chosen columns."""
    simulation = Simulation(make_simulation_plan("funnel", {"balls": 1}, tolerance=tolerance))
    steps = np.zeros(len(times), dtype=step_columns(simulation.plan.scene))
    steps["time"] = times
    for name, values in columns.items():
        steps[name] = values
    simulation.restore(steps, replace(simulation.state, time=float(times[-1])))
    return simulation


def test_table_rows_span_a_tenth_of_a_second_despite_rounding() -> None:
    times = np.cumsum(np.full(3000, 1e-4))  # the border 0.1 is reached at 0.10000000000000184
    rows = list(windows(made(times, contacts=np.arange(3000))))
    assert [row.steps for row in rows] == [1000, 1000, 1000]
    assert [row.contacts for row in rows] == [499.5, 1499.5, 2499.5]


def test_steps_longer_than_a_row_get_a_row_each_and_no_empty_ones() -> None:
    assert [row.time for row in windows(made(np.array([0.25, 0.5, 0.75])))] == [0.25, 0.5, 0.75]


def test_a_row_shows_means_of_costs_and_the_worst_of_errors() -> None:
    times = np.array([0.02, 0.04, 0.06])
    simulation = made(
        times,
        iterations=[1, 2, 6],
        seconds=[0.001, 0.002, 0.003],
        residual=[1e-5, 3e-4, 1e-6],
        penetration=[0.1, 0.3, 0.2],
        kinetic_energy=[1.0, 2.0, 3.0],
        potential_energy=[5.0, 5.0, 5.0],
        balls_through=[0, 1, 4],
    )
    (row,) = windows(simulation)
    assert (row.iterations, row.step_milliseconds) == (3.0, pytest.approx(2.0))
    assert (row.residual, row.penetration, row.unsolved) == (3e-4, 0.3, 1)
    assert (row.energy, row.observed) == (8.0, {"balls_through": 4})


def test_unsolved_steps_are_shown_with_their_number_the_worst_one_and_what_the_solver_says(pour: Pour) -> None:
    simulation = simulate(pour(solver="SORprox", max_iterations=1, tolerance=1e-10))
    text = printed(simulation)
    count = int(simulation.unsolved.sum())
    assert f"{count} of 200 steps are not solved to 1e-10" in text
    assert f"the solver reports: iteration limit, {count} times" in text
    assert "every step is solved" not in text
    assert "the judge confirms that every step is solved to 1e-04" in printed(simulate(pour()))


def test_tolerances_are_shown_exactly() -> None:
    times = np.array([0.1, 0.2])
    assert "every step is solved to 2.4e-04" in printed(made(times, 2.4e-4, residual=[2.3e-4, 0.0]))
    assert "1 of 2 steps is not solved to 2.3e-06" in printed(made(times, 2.3e-6, residual=[1.0, 0.0]))


def test_segments_of_similar_tolerances_show_them_exactly() -> None:
    simulation = made(np.array([0.1, 0.2]), 2.4e-6)
    (first,) = simulation.segments
    simulation.restore(simulation.steps, simulation.state, segments=[first, changed(first, first=1, tolerance=1.6e-6)])
    text = printed(simulation, width=120)
    assert " 2.4e-06 " in text
    assert " 1.6e-06 " in text


def test_messages_about_one_step_are_singular() -> None:
    text = printed(made(np.array([0.1, 0.2]), residual=[1e-3, 0.0]))
    assert "1 of 2 steps is not solved to 1e-04" in text
    assert "no contact, 1 time\n" in text
    assert "1 of 1 step is not solved" in printed(made(np.array([0.1]), residual=1e-3))


@pytest.mark.slow
def test_table_states_that_a_solver_uses_the_convex_model(pour: Pour) -> None:
    text = printed(simulate(pour(solver="ClarabelSOCP", tolerance=1e-6)))
    assert "the solver uses the convex model, not Coulomb friction" in text
    assert "another law" not in printed(simulate(pour(solver="SORprox", max_iterations=1, tolerance=1e-10)))


def test_a_residual_that_is_not_finite_counts_as_unsolved_and_stays_json() -> None:
    simulation = made(np.array([0.1, 0.2]), residual=[np.inf, np.nan])
    assert simulation.unsolved.tolist() == [True, True]
    assert "2 of 2 steps are not solved" in printed(simulation)
    json.dumps(simulation_document(simulation), allow_nan=False)


def test_overlaps_that_the_projection_leaves_are_counted_with_the_largest() -> None:
    simulation = made(np.array([0.1, 0.2, 0.3, 0.4]), overlap=[0.0, 0.67, 0.03, np.nan])
    assert simulation.overlapping.tolist() == [False, True, True, False]
    text = printed(simulation, width=120)
    assert "bodies overlap too deeply after 2 steps" in text
    assert "largest overlap 0.67 r" in text
    assert "overlap" not in printed(made(np.array([0.1, 0.2]), overlap=[0.0, np.nan]))
    found = summary(simulation)
    assert (found["overlapping_steps"], found["largest_overlap"]) == (2, 0.67)
    unknown = summary(made(np.array([0.1, 0.2]), overlap=[0.0, np.nan]))
    assert (unknown["overlapping_steps"], unknown["largest_overlap"]) == (None, None)


@pytest.mark.slow
def test_a_projection_that_ends_early_leaves_overlaps_and_a_complete_one_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sweep does not separate balls that have moved by several radii."""
    complete = simulate(make_simulation_plan("pile", {"balls": 30}, stepper="Moreau(step=0.002)", duration=0.6))
    assert not complete.overlapping.any()
    monkeypatch.setattr("proxbench.problems.motion.stepping.position_projection.MAX_SWEEPS", 1)
    early = simulate(make_simulation_plan("pile", {"balls": 30}, stepper="Moreau(step=0.03)", duration=0.6))
    assert early.overlapping.any()
    assert early.steps["overlap"].max() > 0.1


def test_steps_in_which_fast_contacts_hide_others_are_named_with_their_local_residual() -> None:
    simulation = made(np.array([0.1, 0.2, 0.3]), residual=[1e-5, 1e-5, 0.0], local_residual=[9e-4, 0.5, 1e-18])
    assert simulation.has_hidden_errors.tolist() == [False, True, False]
    text = printed(simulation, width=120)
    assert " local " in text
    assert (
        "fast contacts hide errors of slow ones in 1 step: local residual up to 5.0e-01, judged 1.0e-05, at t = 0.2 s"
        in text
    )
    assert summary(simulation)["hidden_error_steps"] == 1
    plain = printed(made(np.array([0.1]), residual=1e-5, local_residual=9e-4))
    assert "local" not in plain


@pytest.mark.parametrize("width", [80, 120])
def test_table_headings_and_numbers_are_never_truncated(width: int) -> None:
    times = 0.1 * np.arange(1, 12)
    big = made(
        times,
        contacts=12345,
        iterations=2000,
        seconds=123.4,
        residual=3e-4,
        penetration=0.1234,
        kinetic_energy=-1.2345e-4,
        balls_through=1000,
    )
    text = printed(big, width)
    assert "…" not in text
    assert "t [s]" in text
    assert max(len(line) for line in text.splitlines()) <= width


def test_the_summary_relates_the_time_of_steps_alone_to_simulated_time() -> None:
    simulation = made(np.array([1.0, 2.0]), seconds=1.5)
    simulation.wall_seconds = 1000.0  # start and compilation
    assert summary(simulation)["step_seconds_per_simulated_second"] == pytest.approx(1.5)
    assert "3 s wall: 1.5 s per simulated second" in printed(simulation, 80)


def test_live_summary_fits_the_terminal_and_shows_progress(pour: Pour) -> None:
    console = Console(file=io.StringIO(), width=80, force_terminal=True)
    with LiveSummary(console) as live:
        live._interval = 0.0
        simulate(pour(150, solver="SORprox", max_iterations=1, tolerance=1e-10), on_progress=live)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for word in ("of 0.15 s", "steps/s", "contacts", "iterations", "residual", "energy", "unsolved"):
        assert word in text
    assert "…" not in text


def test_a_hidden_live_summary_writes_nothing(pour: Pour) -> None:
    console = Console(file=io.StringIO(), width=80, force_terminal=True)
    with LiveSummary(console, hidden=True) as live:
        simulate(pour(5), on_progress=live)
    assert console.file.getvalue() == ""  # type: ignore[attr-defined]
