"""CSV files contain no formula that a spreadsheet executes, and keep numbers and harmless texts unchanged."""

import io
import re
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from proxbench.bench.report.layout.text import csv_content
from proxbench.bench.report.tables import write_tables
from proxbench.bench.store.frames import RunFrames

FORMULAS = ("=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\n=1", '=HYPERLINK("http://x","y")')
HARMLESS = ("NSGS", "-1.5", "+1e-3", "", "it raised ValueError: a = b", "– none", "'quoted", "1=2")


@pytest.mark.parametrize("text", FORMULAS)
def test_a_text_that_begins_like_a_formula_is_quoted_and_read_back_behind_an_apostrophe(text: str) -> None:
    written = csv_content(pd.DataFrame({"reason": [text], text: ["name"]}))
    read, expected = pd.read_csv(io.BytesIO(written)), "'" + text.replace("\r", "\n")
    assert read.columns.tolist() == ["reason", expected]
    assert read["reason"].tolist() == [expected]


def test_carriage_return_does_not_start_an_executable_cell() -> None:
    written = csv_content(pd.DataFrame({"reason": ["failed\r=1+1"], "n": [1]}))
    assert pd.read_csv(io.BytesIO(written))["reason"].tolist() == ["failed\n=1+1"]


def test_numbers_and_other_texts_stay_as_they_are() -> None:
    table = pd.DataFrame({"text": HARMLESS, "number": range(-4, 4), "float": [-0.5] * 8, "flag": [True] * 8})
    assert csv_content(table) == table.to_csv(index=False).encode()


def test_csv_cells_cannot_be_executed_as_formulas(finished: RunFrames, tmp_path: Path) -> None:
    frames = finished
    cases = frames.cases.assign(reason="=cmd|' /C calc'!A0", family="@SUM(A1)", traceback="")
    cases.loc[cases.index[::2], "outcome"] = "crashed"
    for file in write_tables(replace(frames, cases=cases), tmp_path):
        if file.suffix == ".csv":
            texts = pd.read_csv(file, dtype=str, keep_default_na=False).to_numpy().ravel()
            assert not [text for text in texts if re.match(r"[=+@\t\r]|-(?![\d.])", text)]
    assert "'=cmd|" in (tmp_path / "results.csv").read_text()


def test_csv_is_written_in_one_place() -> None:
    bench = Path(__file__).parents[4] / "bench"
    writers = [file for file in bench.rglob("*.py") if re.search(r"\.to_csv\(|import csv\b", file.read_text())]
    assert [file.relative_to(bench).as_posix() for file in writers] == ["report/layout/text.py"]
