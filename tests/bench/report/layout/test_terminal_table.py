"""Tables fit their width, and no name is broken but between options."""

from io import StringIO
from itertools import pairwise

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.bench.report.layout.terminal_table import fitted, hanging, narrowest, print_table, wrapped_name
from rich.console import Console

WORDS = st.text(alphabet="abcdefgh_", min_size=1, max_size=12)
OPTIONS = st.lists(st.builds("{}={}".format, WORDS, st.one_of(WORDS.map(repr), st.integers().map(str))), max_size=4)


def written(word: str, options: list[str]) -> str:
    return f"{word}({', '.join(options)})" if options else word


PLAIN = st.builds(written, WORDS, OPTIONS)
NAMES = PLAIN | st.builds("{}({})".format, WORDS, PLAIN)


@given(NAMES, st.integers(0, 60))
def test_a_wrapped_name_is_the_name_in_lines_that_end_between_options(name: str, room: int) -> None:
    width = narrowest(name) + room
    lines = wrapped_name(name, width).splitlines()
    assert max(map(len, lines)) <= width
    assert all(line.endswith(("(", ",")) for line in lines[:-1])
    assert "".join(line.strip() for line in lines).replace(" ", "") == name.replace(" ", "")
    assert len(name) > width or lines == [name]


@given(NAMES)
def test_the_narrowest_width_of_a_name_is_the_least_that_holds_it(name: str) -> None:
    least = narrowest(name)
    assert max(map(len, wrapped_name(name, least).splitlines())) == least
    assert max(map(len, wrapped_name(name, least - 1).splitlines())) > least - 1


def table(*names: str) -> pd.DataFrame:
    return pd.DataFrame({"solver": names, "model": "coulomb", "1e-04": "1.15 ms", "iter.": "12", "ended": "solved"})


def test_columns_go_in_the_order_of_their_value_and_only_as_many_as_must() -> None:
    full = table("SORprox(relaxation=1.5)")
    kept = [set(fitted(full, width, ("iter.", "ended")).columns) for width in range(120, 10, -1)]
    assert kept[0] == set(full.columns)
    assert kept[-1] == {"solver", "model", "1e-04"}
    for wider, narrower in pairwise(kept):
        assert narrower <= wider
        assert not ("iter." in narrower and "ended" not in narrower)


@pytest.mark.parametrize("width", [48, 60, 80, 120])
def test_a_printed_table_has_whole_cells_in_its_width(width: int) -> None:
    text = StringIO()
    shown = table("SORprox(relaxation=1.5, form='factors')", "Jprox")
    print_table(Console(file=text, width=width), shown, words=("model",), optional=("iter.", "ended"))
    printed = text.getvalue()
    assert max(map(len, printed.splitlines())) <= width
    for cell in ("SORprox(", "relaxation=1.5,", "form='factors')", "Jprox", "coulomb", "1.15 ms"):
        assert cell in printed


def test_a_note_hangs_below_its_first_line() -> None:
    lines = hanging("SORprox: oscillating, " + 30 * "word ", 40).splitlines()
    assert max(map(len, lines)) <= 40
    assert [len(line) - len(line.lstrip()) for line in lines] == [2] + [4] * (len(lines) - 1)
