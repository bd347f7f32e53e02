"""The table of warm starts."""

import pandas as pd
from starts_table import STARTS, markdown


def test_cells_have_iterations_times_and_the_steps_with_valid_times() -> None:
    columns = "family,solver,tolerance,problems,cold_iterations,warm_iterations,timed,cold_seconds,warm_seconds"
    rows = [
        ("sequence: a", "Robust", 1e-2, 5, 15.8, 10.0, 5, 3.4e-4, 1.7e-4),
        ("sequence: a", "SORprox", 1e-2, 5, 2156.0, 0.2, 2, 0.4519, 0.00226),
        ("sequence: a", "Robust", 1e-4, 5, 20.0, 30.0, 0, float("nan"), float("nan")),
    ]
    assert markdown(pd.DataFrame(rows, columns=columns.split(","))).splitlines()[2:] == [
        "| `a` | 1e-2 | 15.8 → 10; 0.34 → 0.17 | 2156 → 0.2; 450 → 2.3 (2) |",
        "| | 1e-4 | 20 → 30 | – |",
    ]


def test_the_results_page_shows_the_stored_table() -> None:
    page = (STARTS.parents[3] / "docs" / "results.md").read_text(encoding="utf-8")
    assert markdown(pd.read_csv(STARTS)) in page
