"""What all charts share."""

import altair as alt
import pandas as pd
import pytest
from proxbench.bench.report.charts.drawing import MAX_LEGEND_ROWS, heading, log_scale, solver_legend
from proxbench.bench.report.charts.palette import looks


def test_a_logarithmic_scale_is_a_little_wider_than_the_values() -> None:
    values = pd.DataFrame({"low": [0.2, 0.5], "high": [0.3, 9.0]})
    scale = log_scale(values, ["low", "high"], 0.1, reverse=True).to_dict()
    low, high = scale["domain"]
    assert 0.05 < low < 0.1
    assert 9.0 < high < 18.0
    assert scale["reverse"]
    assert "domain" not in log_scale(alt.NamedData(name="rows"), ["low"]).to_dict()


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
