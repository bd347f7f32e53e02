"""What all charts share."""

import pytest
from proxbench.bench.report.charts.drawing import heading, key, round_values
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


@pytest.mark.parametrize("number", [1, 2, 7, 41])
def test_a_key_names_everything_once_and_none_on_another(number: int) -> None:
    names = [f"Solver(option={k})" for k in range(number)]
    chart = key(looks(names), 770.0).to_dict()
    rows = next(rows for rows in chart["datasets"].values() if len(rows) == number)
    assert [row["name"] for row in rows] == names
    assert len({(row["left"], row["y"]) for row in rows}) == number
    assert all(0.0 < row["y"] < chart["height"] for row in rows)
