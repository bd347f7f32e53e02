"""The table of examples in other languages shows their sweeps and the overhead of a call."""

from pathlib import Path

import native_builds
import native_table
import pytest
from proxbench.problems import load
from proxbench.solvers import create


def test_equal_sweeps_are_compared_and_others_are_shown(tmp_path: Path) -> None:
    library = native_builds.sweeps_in_c(tmp_path)
    problems = [load("hard-counterexample"), load("hard-stack-10")]
    *_, unequal, equal, summary = native_table.sweep_rows({"c": create(f"Shared({library})")}, problems, 1)
    assert [cell.strip() for cell in unequal.split("|")][2:5:2] == ["360, oscillating", "36, oscillating"]
    ours, theirs = ([cell.strip() for cell in equal.split("|")][place] for place in (2, 4))
    assert ours == theirs
    assert "1 of 2 equal" in summary


def test_calls_have_a_median_and_a_spread(tmp_path: Path) -> None:
    library = native_builds.faulty_library(tmp_path)
    *_, row = native_table.call_rows({"library": create(f"Shared({library})")}, 3, 4)
    assert row.startswith("| library | ")
    assert row.count("quartiles") == 2


def test_a_language_without_a_compiler_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native_table.os, "system", lambda command: 1)
    assert native_table.build(tmp_path) == {}
    assert capsys.readouterr().out.count("is left out") == 3
