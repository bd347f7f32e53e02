"""The README shows the results of the reference run."""

import io
import re
from pathlib import Path

import pytest
from proxbench.bench import load
from proxbench.bench.report.tables import print_tables
from rich.console import Console

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def lines_in_words(text: str) -> list[str]:
    """Return the lines without the spaces and rules that depend on column widths."""
    lines = [" ".join(line.strip(" ─").split()) for line in text.splitlines()]
    return [line for line in lines if line]


@pytest.mark.slow
def test_rows_in_the_readme_are_those_of_the_reference_run() -> None:
    (block,) = re.findall(r"^```text\n(.*?)^```$", README, re.DOTALL | re.MULTILINE)
    title, head, *rows = lines_in_words(block)
    console = Console(file=io.StringIO(), width=160)
    print_tables(load(ROOT / "results" / "reference.bundle"), console)
    printed = lines_in_words(console.file.getvalue())  # type: ignore[attr-defined]
    begin = printed.index(title)
    end = next(place for place in range(begin, len(printed)) if ": " in printed[place])
    assert printed[begin + 1] == head
    measured = printed[begin + 2 : end]
    assert [row for row in rows if row not in measured] == []
    assert (len(rows), len(measured)) == (11, 15)
    assert "Eleven of the fifteen rows for this problem in [the reference run](results/README.md)" in README
