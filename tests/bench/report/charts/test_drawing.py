"""What all charts share."""

import pytest
from proxbench.bench.report.charts.drawing import MAX_LEGEND_ROWS, heading, round_values, solver_legend
from proxbench.bench.report.charts.palette import looks


@pytest.mark.parametrize("domain", [(0.2, 0.9), (1.0, 37.0), (0.3, 450.0), (1e-3, 1e3), (5e3, 1.0)])
def test_ticks_are_round_few_and_inside(domain: tuple[float, float]) -> None:
    values = round_values(domain)
    assert 2 <= len(values) <= 12
    assert min(domain) <= min(values)
    assert max(values) <= max(domain)


def test_notes_are_wrapped_and_lose_no_word() -> None:
    note = "not shown: " + ", ".join(f"Solver{k}" for k in range(60))
    lines = heading("title", ["", note], 400.0).to_dict()["subtitle"]
    assert len(lines) > 3
    assert " ".join(lines) == note


@pytest.mark.parametrize("number", [1, 7, 41])
def test_a_legend_names_the_solvers_shown_in_their_order(number: int) -> None:
    names = [f"Solver(option={k})" for k in range(number)]
    legend = solver_legend(looks([*names, "Hidden"]), reversed(names)).to_dict()
    assert legend["values"] == names
    assert (legend["columns"] - 1) * MAX_LEGEND_ROWS < number <= legend["columns"] * MAX_LEGEND_ROWS
