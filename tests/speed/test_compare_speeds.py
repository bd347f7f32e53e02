"""Ratios between runs hold whatever the speed of the machine, and compare like with like."""

import json
from pathlib import Path
from typing import Any

import pytest
from compare_speeds import QUARTILES, Mark, compare, last_before, main, noted, read
from proxbench.bench.errors import BenchError


def stored(
    path: Path,
    medians: dict[str, float],
    taken: str = "2030-01-01T00:00:00+00:00",
    processor: str = "abacus",
    **extra: dict[str, Any],
) -> Path:
    """Write a run as pytest-benchmark does, with every name in the file t.py."""
    entries = [
        {"fullname": f"t.py::{name}", "stats": dict.fromkeys(QUARTILES, median), "extra_info": extra.get(name, {})}
        for name, median in medians.items()
    ]
    machine = {"processor": processor, "python": "3.11"}
    path.write_text(json.dumps({"machine_info": machine, "datetime": taken, "benchmarks": entries}))
    return path


def marks(folder: Path, new: dict[str, float], old: dict[str, float], **extra: Any) -> dict[str, Mark]:
    runs = read(stored(folder / "new.json", new, **extra)), read(stored(folder / "old.json", old))
    return {row.name.removeprefix("t.py::"): row.mark for row in compare(*runs)}


@pytest.mark.parametrize("speed", [0.25, 1.0, 3.0])
def test_a_ratio_does_not_depend_on_the_speed_of_the_machine(speed: float, tmp_path: Path) -> None:
    old = {"test_calibration[start]": 1.0, "test_calibration[end]": 4.0, "test_a": 2.0, "test_b": 0.5}
    now = {**old, "test_b": 0.75}
    new = {name: speed * median for name, median in now.items()}
    rows = compare(read(stored(tmp_path / "new.json", new)), read(stored(tmp_path / "old.json", old)))
    ratios = {row.name: row.ratio.value for row in rows if row.ratio}
    assert ratios["t.py::test_a"] == pytest.approx(1.0)
    assert ratios["t.py::test_b"] == pytest.approx(1.5)
    assert ratios["t.py::test_calibration[start]"] == pytest.approx(speed)


def test_drift_between_the_calibrations_of_a_run_enters_by_their_geometric_mean(tmp_path: Path) -> None:
    run = read(stored(tmp_path / "run.json", {"test_calibration[start]": 1.0, "test_calibration[end]": 4.0}))
    assert run.calibration == pytest.approx(2.0)


def test_marks_say_what_became_of_each(tmp_path: Path) -> None:
    old = {"test_calibration": 1.0, "test_slow": 1.0, "test_fast": 1.0, "test_near": 1.0, "test_gone": 1.0}
    new = {"test_calibration": 1.0, "test_slow": 1.31, "test_fast": 0.76, "test_near": 1.29, "test_new": 1.0}
    assert marks(tmp_path, new, old) == {
        "test_calibration": Mark.SAME,
        "test_slow": Mark.SLOWER,
        "test_fast": Mark.FASTER,
        "test_near": Mark.SAME,
        "test_new": Mark.NEW,
        "test_gone": Mark.GONE,
    }


@pytest.mark.parametrize(
    ("ratio", "before", "now", "mark"),
    [
        (1.5, 0.0, 0.9, Mark.UNDER_LOAD),
        (1.5, 0.9, 0.9, Mark.SLOWER),
        (1.5, 0.9, 0.0, Mark.SLOWER),
        (0.5, 0.9, 0.0, Mark.UNDER_LOAD),
        (0.5, 0.0, 0.9, Mark.FASTER),
        (1.1, 0.0, 0.9, Mark.SAME),
    ],
)
def test_a_difference_that_other_programs_explain_is_not_blamed_on_the_code(
    ratio: float, before: float, now: float, mark: Mark, tmp_path: Path
) -> None:
    old = stored(tmp_path / "o", {"test_calibration": 1.0, "test_a": 1.0}, test_a={"load_of_others": before})
    new = stored(tmp_path / "n", {"test_calibration": 1.0, "test_a": ratio}, test_a={"load_of_others": now})
    assert {row.name: row.mark for row in compare(read(new), read(old))}["t.py::test_a"] is mark


@pytest.mark.parametrize(("spread", "mark"), [(0.1, Mark.SLOWER), (0.6, Mark.UNDECIDED)])
def test_a_ratio_whose_interval_contains_one_is_undecided(spread: float, mark: Mark, tmp_path: Path) -> None:
    old = read(stored(tmp_path / "old.json", {"test_calibration": 1.0, "test_a": 1.0}))
    new = read(stored(tmp_path / "new.json", {"test_calibration": 1.0, "test_a": 1.4}))
    new.quartiles["t.py::test_a"] = [1.4 - spread, 1.4, 1.4 + spread]
    row = next(row for row in compare(new, old) if row.name == "t.py::test_a")
    assert row.mark is mark
    assert row.ratio is not None
    assert row.ratio == pytest.approx((1.4, 1.4 - spread, 1.4 + spread), rel=0.02)


def test_times_of_different_problems_are_not_compared(tmp_path: Path) -> None:
    medians = {"test_calibration": 1.0, "test_a": 1.0}
    assert marks(tmp_path, medians, medians, test_a={"digest": "f00"})["test_a"] is Mark.OTHER


def test_without_an_earlier_run_there_are_no_ratios(tmp_path: Path) -> None:
    rows = compare(read(stored(tmp_path / "new.json", {"test_calibration": 1.0})), None)
    assert [(row.ratio, row.mark) for row in rows] == [(None, Mark.NEW)]


def test_the_last_run_is_the_one_measured_last_before_whatever_its_file_is_called(tmp_path: Path) -> None:
    medians = {"test_calibration": 1.0}
    for name, year in (("z", 2027), ("a", 2029), ("m", 2028), ("later", 2031)):
        stored(tmp_path / f"{name}.json", medians, f"{year}-01-01T00:00:00+00:00")
    (tmp_path / "interrupted.json").write_text("{")
    new = read(stored(tmp_path / "new.json", medians))
    last = last_before(new, tmp_path)
    assert last is not None
    assert last.path.name == "a.json"
    assert last_before(read(tmp_path / "z.json"), tmp_path) is None


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read"),
        ("{", "holds no speeds"),
        ("[]", "holds no speeds"),
        ('{"machine_info": {}}', "holds no speeds"),
        ({"test_a": 1.0}, "holds no test_calibration"),
        ({"test_calibration": 0.0}, "not positive"),
    ],
)
def test_a_file_that_is_no_run_is_named_with_the_reason(content: Any, words: str, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    if isinstance(content, str):
        path.write_text(content)
    elif content:
        stored(path, content)
    with pytest.raises(BenchError, match=words) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_the_table_names_what_is_slower_and_another_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old = stored(tmp_path / "old.json", {"test_calibration": 1.0, "test_a[x]": 1.0}, processor="slide rule")
    new = stored(tmp_path / "new.json", {"test_calibration": 2.0, "test_a[x]": 4.0})
    assert main([str(new), str(old)]) == 0
    shown_text = capsys.readouterr().out
    assert "a[x]" in shown_text
    assert "1 slower than 1.3 times: a[x]" in shown_text
    assert "slide rule, Python 3.11 before, abacus, Python 3.11 now" in shown_text
    assert "2.00 times as long" in shown_text


def test_wrong_usage_gets_one_sentence_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert main([str(tmp_path / "none.json"), str(tmp_path)]) == 2
    assert "none.json cannot be read" in capsys.readouterr().err


def test_notes_are_words_and_numbers_without_the_digest() -> None:
    extra = {"problem": "funnel-30", "digest": "f00", "iterations": 146, "judged_residual": 8.891e-05}
    assert noted(extra) == "funnel-30, iterations 146, judged residual 8.9e-05"
