"""Figures are compared with what is accepted, and a slower one is found, named and accepted by name."""

from pathlib import Path

import numpy as np
import pytest
from figures import FIGURES, pour, seconds
from pair import FIGURES_FILE, ROOT, ROUNDS, SLOWER, Comparison, accepted, install, line, main, measure
from proxbench.bench.errors import BenchError

FIRST, *OTHERS = FIGURES
ANSWERS = """
import json, sys
for line in sys.stdin:
    print(json.dumps({answer}), flush=True)
"""
"""A child that answers every command alike."""


def written(folder: Path, text: str) -> Path:
    path = folder / "accepted.toml"
    path.write_text(text, encoding="utf-8")
    return path


def compared(
    folder: Path, monkeypatch: pytest.MonkeyPatch, new: dict[str, object], old: dict[str, object]
) -> Comparison:
    """The comparison of two states that answer every command with these."""
    root, site = folder / "root", folder / "site"
    for path, answer in ((root / FIGURES_FILE, new), (site / "figures.py", old)):
        path.parent.mkdir(parents=True)
        path.write_text(ANSWERS.format(answer=answer), encoding="utf-8")
    monkeypatch.setattr("pair.ROOT", root)
    comparison = Comparison(FIRST, "a" * 40)
    measure([comparison], site, folder)
    return comparison


def test_a_figure_that_is_accepted_by_name_has_a_commit_of_its_own(tmp_path: Path) -> None:
    text = f'commit = "abc"\n[accepted."{FIRST}"]\ncommit = "def"\nreason = "it checks more"'
    commits = {comparison.figure: comparison.commit for comparison in accepted(written(tmp_path, text))}
    assert commits == {FIRST: "def", **dict.fromkeys(OTHERS, "abc")}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "must name a commit"),
        ("commit", "must name a commit"),
        ('commit = "abc"\n[accepted."faster"]\ncommit = "d"\nreason = "r"', "accepts 'faster', which is no figure"),
        (f'commit = "abc"\n[accepted."{FIRST}"]\ncommit = "d"\nreason = " "', "has no reason"),
        (f'commit = "abc"\n[accepted."{FIRST}"]\ncommit = "d"', "a commit and a reason for each figure"),
    ],
)
def test_what_accepts_nothing_or_gives_no_reason_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(BenchError, match=sentence):
        accepted(written(tmp_path, text))


def test_the_accepted_states_of_this_project_can_be_read() -> None:
    assert [comparison.figure for comparison in accepted(ROOT / "results/speed/accepted.toml")] == list(FIGURES)


@pytest.mark.parametrize(("ratio", "is_slower"), [(1.0, False), (1.1, False), (1.2, True), (0.5, False)])
def test_a_figure_is_slower_if_its_whole_interval_is_above_the_limit(ratio: float, is_slower: bool) -> None:
    noise = 0.02 * np.random.default_rng(0).normal(size=2 * ROUNDS)
    comparison = Comparison(FIRST, "a", list(np.log(ratio) + noise))
    assert comparison.is_slower is is_slower
    assert comparison.is_decided


def test_what_one_pair_of_processes_finds_slower_is_measured_by_another() -> None:
    comparison = Comparison(FIRST, "a", list(np.log(1.3) + 0.01 * np.random.default_rng(0).normal(size=ROUNDS)))
    assert comparison.is_slower
    assert not comparison.is_decided


def test_what_is_neither_slower_nor_surely_not_is_measured_again() -> None:
    comparison = Comparison(FIRST, "a", list(np.log(SLOWER) + 0.1 * np.random.default_rng(0).normal(size=ROUNDS)))
    assert not comparison.is_slower
    assert not comparison.is_decided


def test_the_ratio_is_that_of_the_times_of_both_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = compared(tmp_path, monkeypatch, {"seconds": 6.0}, {"seconds": 5.0})
    assert comparison.ratio.value == pytest.approx(1.2)
    assert comparison.is_slower
    assert line(comparison).endswith("aaaaaaaa   slower")


def test_a_figure_that_the_old_state_lacks_is_new(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comparison = compared(tmp_path, monkeypatch, {"seconds": 6.0}, {"missing": "ImportError: no such name"})
    assert not comparison.is_slower
    assert "new, aaaaaaaa has no such figure (ImportError: no such name)" in line(comparison)


def test_a_figure_that_fails_now_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(BenchError, match=f"the figure '{FIRST}' fails: KeyError: 'a'"):
        compared(tmp_path, monkeypatch, {"missing": "KeyError: 'a'"}, {"seconds": 5.0})


def test_a_commit_that_the_clone_does_not_hold_is_skipped_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("pair.pour", lambda folder: None)
        assert main(["0" * 40]) == 0
    printed = capsys.readouterr().out
    assert f"Skipped: commit {'0' * 40} is not in this clone" in printed
    assert "None of 0 compared figures" in printed


def test_a_slower_figure_is_named_with_what_accepts_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slow_down(comparisons: list[Comparison], site: Path, folder: Path) -> None:
        for comparison in comparisons:
            comparison.logarithms += [np.log(1.3 if comparison.figure == FIRST else 1.0)] * ROUNDS
            comparison.seconds = 1e-3

    monkeypatch.setattr("pair.measure", slow_down)
    monkeypatch.setattr("pair.install", lambda commit: tmp_path)
    monkeypatch.setattr("pair.pour", lambda folder: None)
    assert main(["abc"]) == 1
    printed = capsys.readouterr().out
    assert f"Slower than 1.15 times: {FIRST}. Make" in printed
    assert f'[accepted."{FIRST}"]\ncommit = ' in printed


def test_an_installed_state_is_used_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pair.STATES", tmp_path)
    monkeypatch.setattr("pair.archived", lambda commit: b"")
    (tmp_path / "abc").mkdir()
    assert install("abc") == tmp_path / "abc"


@pytest.mark.slow
@pytest.mark.parametrize("figure", FIGURES)
def test_every_figure_can_be_repeated(figure: str, tmp_path: Path) -> None:
    if "balls" in figure:
        pour(tmp_path)
    assert seconds(FIGURES[figure](tmp_path), 2) > 0.0
