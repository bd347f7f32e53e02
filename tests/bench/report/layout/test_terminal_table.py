"""Tables fit their width: the least important columns are omitted first, and no cell is truncated."""

from io import StringIO
from itertools import pairwise

import pandas as pd
import pytest
from proxbench.bench.report.layout.terminal_table import column_groups, print_table, wrap_note
from rich.console import Console


def table(*names: str) -> pd.DataFrame:
    return pd.DataFrame({"solver": names, "model": "coulomb", "1e-04": "1.15 ms", "iter.": "12", "ended": "solved"})


def printed(shown: pd.DataFrame, width: int) -> str:
    text = StringIO()
    print_table(Console(file=text, width=width), shown, left_aligned=("model",), optional=("iter.", "ended"))
    return text.getvalue()


def test_columns_are_left_out_in_the_order_of_their_value_and_only_as_many_as_must() -> None:
    full = table("SORprox(relaxation=1.5)")
    kept = [set(printed(full, width).splitlines()[0].split()) for width in range(120, 41, -1)]
    assert kept[0] == set(full.columns)
    assert kept[-1] == {"solver", "model", "1e-04"}
    for wider, narrower in pairwise(kept):
        assert narrower <= wider
        assert not ("iter." in narrower and "ended" not in narrower)


@pytest.mark.parametrize("width", [43, 60, 80, 120])
def test_a_printed_table_has_whole_cells_in_its_width(width: int) -> None:
    text = printed(table("SORprox(relaxation=1.5, form='factors')", "Jprox"), width)
    assert max(map(len, text.splitlines())) <= width
    for cell in ("SORprox(relaxation=1.5,", "form='factors')", "Jprox", "coulomb", "1.15 ms"):
        assert cell in text


def test_the_cells_of_winners_alone_are_bold() -> None:
    text = StringIO()
    console = Console(file=text, width=80, force_terminal=True)
    print_table(console, table("A", "B"), bold={(1, "1e-04")})
    rows = text.getvalue().splitlines()[-2:]
    assert ["\x1b[1;32m1.15 ms" in row for row in rows] == [False, True]


@pytest.mark.parametrize("width", [30, 60, 200])
def test_groups_of_columns_fit_side_by_side_and_lose_none(width: int) -> None:
    shown = table("SORprox(relaxation=1.5)").assign(more="x" * 25)
    groups = column_groups(shown, width)
    assert [name for group in groups for name in group] == list(shown.columns.drop("solver"))
    assert len(groups) == {30: 5, 60: 2, 200: 1}[width]


def test_a_note_hangs_below_its_first_line() -> None:
    lines = wrap_note("SORprox: oscillating, " + 30 * "word ", 40).splitlines()
    assert max(map(len, lines)) <= 40
    assert [len(line) - len(line.lstrip()) for line in lines] == [2] + [4] * (len(lines) - 1)


def test_a_unit_in_brackets_stays_in_the_head() -> None:
    head = printed(table("A").rename(columns={"1e-04": "wall [s]"}), 80).splitlines()[0]
    assert "wall [s]" in head
