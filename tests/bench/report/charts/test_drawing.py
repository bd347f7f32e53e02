"""Properties that all charts share."""

import altair as alt
import pandas as pd
import pytest
from proxbench.bench.report.charts.drawing import (
    MAX_LEGEND_ROWS,
    heading,
    log_scale,
    name_labels,
    short_names,
    solver_legend,
)
from proxbench.bench.report.charts.palette import solver_styles


def test_a_logarithmic_scale_is_a_little_wider_than_the_values() -> None:
    values = pd.DataFrame({"low": [0.2, 0.5], "high": [0.3, 9.0]})
    scale = log_scale(values, ["low", "high"], 0.1, reverse=True).to_dict()
    low, high = scale["domain"]
    assert 0.05 < low < 0.1
    assert 9.0 < high < 18.0
    assert scale["reverse"]
    assert "domain" not in log_scale(alt.NamedData(name="rows"), ["low"]).to_dict()


def test_wrapping_a_note_keeps_every_word() -> None:
    note = "not shown: " + ", ".join(f"Solver{k}" for k in range(60))
    lines = heading("title", ["", note], 400.0).to_dict()["subtitle"]
    assert len(lines) > 3
    assert " ".join(lines) == note


@pytest.mark.parametrize("number", [1, 7, 41])
def test_a_legend_names_the_solvers_shown_in_their_order(number: int) -> None:
    names = [f"Solver(option={k})" for k in range(number)]
    legend = solver_legend(solver_styles([*names, "Hidden"]), reversed(names)).to_dict()
    assert legend["values"] == names
    assert (legend["columns"] - 1) * MAX_LEGEND_ROWS < number <= legend["columns"] * MAX_LEGEND_ROWS


@pytest.mark.parametrize(
    ("least", "largest", "domain"),
    [(2e-5, 4e-5, [1e-5, 1e-4]), (8e-6, 4e-5, [1e-6, 1e-4]), (0.9e-5, 0.9e-5, [1e-6, 1e-4])],
)
def test_an_axis_with_ticks_at_powers_of_ten_contains_two_of_them(
    least: float, largest: float, domain: list[float]
) -> None:
    values = pd.DataFrame({"residual": [least, largest]})
    assert log_scale(values, ["residual"], has_decades=True).to_dict()["domain"] == pytest.approx(domain)
    assert log_scale(values, ["residual"]).to_dict()["domain"] == pytest.approx([least / 1.2, largest * 1.2])


def test_an_axis_over_several_powers_of_ten_is_no_wider_than_its_values() -> None:
    values = pd.DataFrame({"residual": [2e-8, 4e-2]})
    scales = [log_scale(values, ["residual"], has_decades=has_decades).to_dict() for has_decades in (True, False)]
    assert scales[0] == scales[1]


LONG = "Fallback(SORprox(relaxation=1.5, form='factors'), NSGS, SORprox, {})"


def test_a_long_name_keeps_both_ends_and_a_short_one_all_of_it() -> None:
    names = [LONG.format("Robust"), LONG.format("Jprox"), "NSGS"]
    labels = short_names(names, width=300.0)
    assert all(len(label) <= 300.0 / (0.56 * 11) for label in labels.values())
    assert labels[names[0]].startswith("Fallback(SORprox(")
    assert labels[names[0]].endswith("SORprox, Robust)")
    assert labels[names[1]].endswith("SORprox, Jprox)")
    assert labels["NSGS"] == "NSGS"
    assert "labelExpr" not in name_labels(["NSGS"])


@pytest.mark.parametrize("place", ["start", "middle", "end"])
def test_different_names_have_different_labels(place: str) -> None:
    parts = {"start": "{}" + "x" * 90, "middle": "x" * 45 + "{}" + "x" * 45, "end": "x" * 90 + "{}"}
    names = [parts[place].format(letter) for letter in "abc"]
    assert len(set(short_names(names).values())) == len(names)
