"""Figures are compared with accepted states; a slower one is found, named, and can be accepted by name."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from figures import FIGURES, pour, seconds
from pair import (
    FIGURES_FILE,
    ROOT,
    ROUNDS,
    SLOWER,
    Comparison,
    accepted,
    commit_hash,
    compare,
    install,
    line,
    main,
    measure,
)
from proxbench.bench.errors import BenchError

FIRST, *OTHERS = FIGURES
HASH = "0123456789abcdef0123456789abcdef01234567"
BASE = '[[bases]]\ncommit = "abc"\nreason = "the first one"\n'
ANSWERS = """
import json, sys
for line in sys.stdin:
    print(json.dumps({answer}), flush=True)
"""
"""Program of a child that gives the same answer to every command."""


def written(folder: Path, text: str) -> Path:
    path = folder / "accepted.toml"
    path.write_text(text, encoding="utf-8")
    return path


def compared(
    folder: Path, monkeypatch: pytest.MonkeyPatch, new: dict[str, object], old: dict[str, object]
) -> Comparison:
    """Return the comparison of two states that give these answers to every command."""
    root, site = folder / "root", folder / "site"
    for path, answer in ((root / FIGURES_FILE, new), (site / "figures.py", old)):
        path.parent.mkdir(parents=True)
        path.write_text(ANSWERS.format(answer=answer), encoding="utf-8")
    monkeypatch.setattr("pair.ROOT", root)
    comparison = Comparison(FIRST, "a" * 40)
    measure([comparison], site, folder)
    return comparison


def test_a_figure_that_is_accepted_by_name_has_a_commit_of_its_own(tmp_path: Path) -> None:
    text = f'{BASE}[accepted."{FIRST}"]\ncommit = "def"\nreason = "it checks more"'
    comparisons, _ = accepted(written(tmp_path, text))
    commits = {comparison.figure: comparison.commit for comparison in comparisons}
    assert commits == {FIRST: "def", **dict.fromkeys(OTHERS, "abc")}


def test_the_last_base_is_compared_and_the_first_is_suggested_for_the_total_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bases = [f'[[bases]]\ncommit = "{number}00000000"\nreason = "r"\n' for number in range(3)]
    comparisons, commits = accepted(written(tmp_path, "".join(bases)))
    assert {comparison.commit for comparison in comparisons} == {commits[-1]} == {"200000000"}
    measure_as({}, tmp_path, monkeypatch)
    monkeypatch.setattr("pair.ACCEPTED", tmp_path / "accepted.toml")
    words = "Earlier bases: 2; python tests/speed/pair.py 00000000 compares with the first one."
    assert main([]) == 0
    assert words in capsys.readouterr().out
    written(tmp_path, bases[0])
    assert main([]) == 0
    assert "Earlier bases" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "a commit and a reason for each base"),
        ("bases", "a commit and a reason for each base"),
        ("bases = []", "at least one base"),
        (f'{BASE}[[bases]]\ncommit = "d"', "a commit and a reason for each base"),
        (f'{BASE}[[bases]]\ncommit = "d"\nreason = " "', "at least one base, and a reason for each"),
        (f'{BASE}[accepted."faster"]\ncommit = "d"\nreason = "r"', "accepts 'faster', which is no figure"),
        (f'{BASE}[accepted."{FIRST}"]\ncommit = "d"\nreason = " "', "has no reason"),
        (f'{BASE}[accepted."{FIRST}"]\ncommit = "d"', "a commit and a reason for each base and figure"),
    ],
)
def test_an_entry_without_a_commit_figure_or_reason_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(BenchError, match=sentence):
        accepted(written(tmp_path, text))


def test_the_accepted_states_of_this_project_can_be_read() -> None:
    comparisons, _ = accepted(ROOT / "results/speed/accepted.toml")
    assert [comparison.figure for comparison in comparisons] == list(FIGURES)


@pytest.mark.parametrize(("ratio", "is_slower"), [(1.0, False), (1.1, False), (1.2, True), (0.5, False)])
def test_a_figure_is_slower_if_its_whole_interval_is_above_the_limit(ratio: float, is_slower: bool) -> None:
    noise = 0.02 * np.random.default_rng(0).normal(size=2 * ROUNDS)
    comparison = Comparison(FIRST, "a", list(np.log(ratio) + noise))
    assert comparison.is_slower is is_slower
    assert comparison.is_decided


def test_slowdown_found_by_one_pair_of_processes_is_undecided() -> None:
    comparison = Comparison(FIRST, "a", list(np.log(1.3) + 0.01 * np.random.default_rng(0).normal(size=ROUNDS)))
    assert comparison.is_slower
    assert not comparison.is_decided


def test_undecided_figures_are_measured_again() -> None:
    comparison = Comparison(FIRST, "a", list(np.log(SLOWER) + 0.1 * np.random.default_rng(0).normal(size=ROUNDS)))
    assert not comparison.is_slower
    assert not comparison.is_decided
    assert comparison.verdict == "undecided"
    assert line(comparison).endswith("undecided")


@pytest.mark.parametrize(("ratio", "verdict"), [(1.0, ""), (1.1, ""), (1.2, "slower"), (0.5, "faster")])
def test_the_verdict_is_given_only_where_the_ratio_differs_by_more_than_the_limit(ratio: float, verdict: str) -> None:
    noise = 0.02 * np.random.default_rng(0).normal(size=2 * ROUNDS)
    assert Comparison(FIRST, "a", list(np.log(ratio) + noise)).verdict == verdict


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


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_missing_commit_is_skipped_with_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("pair.pour", lambda folder: None)
        assert main(["0" * 40]) == 0
    printed = capsys.readouterr().out
    assert f"Skipped: commit {'0' * 40} is not in this clone" in printed
    assert "None of 0 compared figures" in printed


def test_a_branch_is_compared_as_the_commit_that_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    words: list[list[str]] = []

    def answer(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        words.append(command)
        return subprocess.CompletedProcess(command, 0, stdout=f"{HASH}\n")

    monkeypatch.setattr("pair.subprocess.run", answer)
    assert commit_hash("main") == HASH
    assert words[0][-1] == "main^{commit}"


def measure_as(ratios: dict[str, list[float]], folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Make each pair of processes measure these ratios, 1.0 for other figures; return the installed commits."""
    installed: list[str] = []

    def add_pairs(comparisons: list[Comparison], site: Path, folder: Path) -> None:
        for comparison in comparisons:
            found = np.resize(ratios.get(comparison.figure, [1.0]), ROUNDS)
            comparison.logarithms += np.log(found).tolist()
            comparison.seconds = 1e-3

    monkeypatch.setattr("pair.measure", add_pairs)
    monkeypatch.setattr("pair.install", lambda commit: installed.append(commit) or folder)
    monkeypatch.setattr("pair.commit_hash", lambda name: HASH)
    monkeypatch.setattr("pair.pour", lambda folder: None)
    return installed


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_speeds_are_stored_by_commit_only_if_it_is_what_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measure_as({FIRST: [0.8]}, tmp_path, monkeypatch)
    monkeypatch.setattr("pair.HISTORY", tmp_path / "history.csv")
    monkeypatch.setattr("pair.ROOT", tmp_path)
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    (tmp_path / "code.py").write_text("a")
    for words in (["init", "-q"], ["add", "code.py"], ["commit", "-qm", "one"]):
        subprocess.run([*git, *words], check=True)
    assert [main(["--store", "main"]) for _ in range(2)] == [0, 0]
    rows = pd.read_csv(tmp_path / "history.csv")
    assert rows["figure"].tolist() == [*FIGURES, *FIGURES]
    assert set(rows["commit"]) == set(rows["base"]) == {HASH}
    assert rows.set_index("figure")["ratio"][FIRST].tolist() == pytest.approx([0.8, 0.8])
    (tmp_path / "code.py").write_text("b")
    assert main(["--store", "main"]) == 2
    assert "code.py has changes; speeds are stored by commit, so commit them first." in capsys.readouterr().err
    assert len(pd.read_csv(tmp_path / "history.csv")) == 2 * len(FIGURES)


def test_figures_that_stay_undecided_are_shown_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed = measure_as({figure: [0.9, 1.5] for figure in OTHERS[:2]}, tmp_path, monkeypatch)
    assert main(["main"]) == 0
    printed = capsys.readouterr().out
    assert installed == [HASH]
    assert f"main is commit {HASH}." in printed
    assert printed.count(f"{HASH:.8}   undecided\n") == 2
    assert f"None of {len(FIGURES)} compared figures is certainly slower than 1.15 times; 2 are undecided." in printed


@pytest.mark.parametrize(("words", "code"), [(["--help"], 0), (["main", "HEAD"], 2), (["--stor=1"], 2), (["-x"], 2)])
def test_a_word_that_is_no_commit_measures_nothing(
    words: list[str], code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed = measure_as({}, tmp_path, monkeypatch)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == code
    assert installed == []
    printed = capsys.readouterr()
    assert (printed.err or printed.out).startswith("usage: python tests/speed/pair.py [-h] [--store] [COMMIT]")


def test_a_slower_figure_is_named_with_what_accepts_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measure_as({FIRST: [1.3]}, tmp_path, monkeypatch)
    assert main([HASH[:8]]) == 1
    printed = capsys.readouterr().out
    assert "is commit" not in printed
    assert f"Slower than 1.15 times: {FIRST}. Make" in printed
    assert f'[accepted."{FIRST}"]\ncommit = ' in printed


SLOWED = """
import sys, time
from pathlib import Path
sys.path.insert(0, {folder!r})
import figures

def slowed(repeat):
    def longer():
        began = time.process_time()
        repeat()
        end = began + {factor} * (time.process_time() - began)
        while time.process_time() < end:
            pass
    return longer

make = figures.FIGURES[{figure!r}]
figures.FIGURES[{figure!r}] = lambda folder: slowed(make(folder))
for answer in figures.answers(Path(sys.argv[1])):
    print(figures.json.dumps(answer), flush=True)
"""
"""Program of the figures of this state, in which one figure is slowed down by a factor."""


@pytest.mark.weekly
@pytest.mark.parametrize(("factor", "code"), [(1.0, 0), (1.2, 1)])
def test_a_figure_that_is_slowed_down_by_a_fifth_is_found(
    factor: float, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both states are the present one, measured in separate processes by the clock of the system."""
    figure, folder = "hundred sweeps over matrix", str(ROOT / "tests" / "speed")
    for path, times in ((tmp_path / "root" / FIGURES_FILE, factor), (tmp_path / "site" / "figures.py", 1.0)):
        path.parent.mkdir(parents=True)
        path.write_text(SLOWED.format(folder=folder, figure=figure, factor=times), encoding="utf-8")
    environment = {name: os.environ[name] for name in ("PYTHONPATH", "NUMBA_CACHE_DIR") if name in os.environ}
    start = subprocess.Popen

    def start_here(words: list[str], **options: Any) -> Any:
        """Start a process that imports this package in both states."""
        return start(words, **options | {"env": options["env"] | environment})

    monkeypatch.setattr("pair.subprocess.Popen", start_here)
    monkeypatch.setattr("pair.install", lambda commit: tmp_path / "site")
    monkeypatch.setattr("pair.pour", lambda folder: None)
    monkeypatch.setattr("pair.commit_hash", lambda name: HASH)
    monkeypatch.setattr("pair.ROOT", tmp_path / "root")
    monkeypatch.setattr("pair.ACCEPTED", tmp_path / "root" / "accepted.toml")
    assert compare([Comparison(figure, HASH)]) == code


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
