"""Compare two runs of this suite, with the speed of the machine divided out.

    ratio = (median / median before) / (calibration / calibration before)

The interval of a ratio is that of ``proxbench.bench.store.ratios`` between the quartiles of both runs, all that
pytest-benchmark stores of their rounds.

``python tests/speed/compare_speeds.py NEW.json OLD`` prints a table. If OLD is a folder, it takes the last run there
that was measured before NEW.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from statistics import geometric_mean
from typing import Any

import numpy as np
from proxbench.bench.errors import BenchError
from proxbench.bench.report.cells import duration
from proxbench.bench.store.ratios import Ratio, bootstrap_ratio
from rich.console import Console
from rich.table import Table
from rich.text import Text

CALIBRATION = "test_calibration"
"""Prefix of the benchmarks whose ratio divides all others."""

SLOWER = 1.3
"""Ratio above which a benchmark is marked as slower; below its inverse it is marked as faster."""

MAX_EXTRA_LOAD = 0.3
"""Cores kept busy by other programs in one run only that may explain a difference."""

QUARTILES = ("q1", "median", "q3")
"""Times of a benchmark that enter its ratio."""


class Mark(StrEnum):
    """Result of the comparison of a benchmark."""

    SAME = ""
    SLOWER = "slower"
    FASTER = "faster"
    UNDECIDED = "undecided"
    UNDER_LOAD = "under load"
    NEW = "new"
    GONE = "gone"
    OTHER = "other problem"


@dataclass(frozen=True)
class Speeds:
    """One stored run.

    Attributes:
        path: its file.
        taken: when it was measured.
        machine: processor and version of Python, which must agree for ratios to hold.
        quartiles: of the times [s] of each benchmark, by its name with the file.
        extra: other values that each benchmark recorded (``digest``, ``iterations``, …).
    """

    path: Path
    taken: datetime
    machine: str
    quartiles: dict[str, list[float]]
    extra: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def calibration(self) -> float:
        """Geometric mean of the calibrations [s], which are spread over the run."""
        return geometric_mean([self.median(name) for name in self.quartiles if is_calibration(name)])

    def median(self, name: str) -> float:
        """Median time of a benchmark [s]."""
        return self.quartiles[name][1]

    def load_of_others(self, name: str) -> float:
        """Cores that other programs kept busy during a benchmark, 0 if it is not recorded."""
        return float(self.extra[name].get("load_of_others", 0.0))


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: name of the benchmark, with its file.
        median: median time [s] now, or before for one that is gone.
        ratio: the calibrated ratio, None if it is in one run only.
        mark: result of the comparison.
        note: other values that it recorded.
    """

    name: str
    median: float
    ratio: Ratio | None
    mark: Mark
    note: str


def read(path: Path) -> Speeds:
    """Read the JSON of pytest-benchmark.

    Raises:
        BenchError: if it cannot be read, is something else, or holds no calibration.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        machine = document["machine_info"]
        speeds = Speeds(
            path,
            datetime.fromisoformat(document["datetime"]),
            f"{machine['processor']}, Python {machine['python']}",
            {entry["fullname"]: [float(entry["stats"][key]) for key in QUARTILES] for entry in document["benchmarks"]},
            {entry["fullname"]: entry["extra_info"] for entry in document["benchmarks"]},
        )
    except OSError as error:
        raise BenchError(f"{path} cannot be read ({error.strerror}); nox -s speed writes such files.") from None
    except (ValueError, KeyError, TypeError):
        raise BenchError(f"{path} holds no speeds; it must be what nox -s speed writes.") from None
    if not all(0.0 < seconds < float("inf") for times in speeds.quartiles.values() for seconds in times):
        raise BenchError(f"{path} holds a time that is not positive; it must be what nox -s speed writes.")
    if not any(map(is_calibration, speeds.quartiles)):
        raise BenchError(f"{path} holds no {CALIBRATION}, so its times cannot be compared; run it with the others.")
    return speeds


def last_before(new: Speeds, folder: Path) -> Speeds | None:
    """Return the run in ``folder`` that was measured last before ``new``, None if there is none.

    Files that hold no comparable run are passed over: a run that was interrupted must not stop the next.
    """
    earlier = []
    for path in folder.glob("*.json"):
        try:
            speeds = read(path)
        except BenchError:
            continue
        if speeds.taken < new.taken:
            earlier.append(speeds)
    return max(earlier, key=lambda speeds: speeds.taken, default=None)


def compare(new: Speeds, old: Speeds | None) -> list[Row]:
    """Return a row for each benchmark of ``new``, and then for those that only ``old`` has."""
    rows = []
    for name in new.quartiles:
        ratio, mark = None, Mark.NEW
        if old and name in old.quartiles:
            if new.extra[name].get("digest") != old.extra[name].get("digest"):
                mark = Mark.OTHER
            elif is_calibration(name):  # its ratio is that of the machine
                ratio, mark = calibrated_ratio(new, old, name, 1.0), Mark.SAME
            else:
                ratio = calibrated_ratio(new, old, name, new.calibration / old.calibration)
                mark = marked(ratio, new.load_of_others(name) - old.load_of_others(name))
        rows.append(Row(name, new.median(name), ratio, mark, noted(new.extra[name])))
    gone = [name for name in old.quartiles if name not in new.quartiles] if old else []
    return [*rows, *(Row(name, old.median(name), None, Mark.GONE, "") for name in gone if old)]


def calibrated_ratio(new: Speeds, old: Speeds, name: str, machine: float) -> Ratio:
    """Return the ratio of the times of a benchmark, divided by that of the machine."""
    return bootstrap_ratio(np.log(new.quartiles[name]) - np.log(machine), np.log(old.quartiles[name]))


def marked(ratio: Ratio, more_load: float) -> Mark:
    """Return the mark of a ratio, if other programs kept ``more_load`` cores more busy than before."""
    if ratio.value > SLOWER:
        return Mark.UNDER_LOAD if more_load > MAX_EXTRA_LOAD else Mark.SLOWER if ratio.low > 1.0 else Mark.UNDECIDED
    if ratio.value < 1.0 / SLOWER:
        return Mark.UNDER_LOAD if more_load < -MAX_EXTRA_LOAD else Mark.FASTER if ratio.high < 1.0 else Mark.UNDECIDED
    return Mark.SAME


def noted(extra: dict[str, Any]) -> str:
    """Return the recorded values of a benchmark as text, without those that only programs read."""
    parts = []
    for key, value in extra.items():
        if key in ("digest", "load_of_others"):
            continue
        if isinstance(value, str):
            parts.append(value)
        else:
            number = f"{value:.1e}" if key.endswith("residual") else f"{value:.4g}"
            parts.append(f"{key.replace('_', ' ')} {number}")
    return ", ".join(parts)


def short(name: str) -> str:
    """Return the name of a benchmark without its file and without the word test."""
    return name.rpartition("::")[2].removeprefix("test_")


def is_calibration(name: str) -> bool:
    """Return whether a benchmark measures the machine."""
    return name.rpartition("::")[2].startswith(CALIBRATION)


def table(rows: Sequence[Row], title: str) -> Table:
    """Return the rows as a table for a terminal."""
    drawn = Table(title=title, box=None, padding=(0, 1))
    for column in ("name", "median", "ratio", "interval", "", "note"):
        is_number = column in ("median", "ratio", "interval")
        drawn.add_column(column, justify="right" if is_number else "left", overflow="fold")
    colours = {Mark.SLOWER: "bold red", Mark.FASTER: "green"}
    for row in rows:
        ratio = (
            ("", "") if row.ratio is None else (f"{row.ratio.value:.2f}", f"{row.ratio.low:.2f}–{row.ratio.high:.2f}")
        )
        cells = (short(row.name), duration(row.median), *ratio, row.mark, row.note)
        drawn.add_row(*(Text(cell) for cell in cells), style=colours.get(row.mark))
    return drawn


def report(new: Speeds, old: Speeds | None, console: Console) -> None:
    """Print the table and its summary."""
    if old is None:
        console.print(table(compare(new, None), f"{new.path.name}, nothing before it to compare with"))
        return
    rows = compare(new, old)
    console.print(table([row for row in rows if row.mark is not Mark.GONE], f"{new.path.name} against {old.path.name}"))
    if new.machine != old.machine:
        console.print(f"The machines differ: {old.machine} before, {new.machine} now; ratios are rough at best.")
    for mark, words in (
        (Mark.GONE, "in the earlier run only"),
        (Mark.UNDER_LOAD, "measured under load in one of the runs"),
        (Mark.UNDECIDED, f"beyond {SLOWER} times with an interval that contains 1"),
        (Mark.SLOWER, f"slower than {SLOWER} times"),
    ):
        names = [short(row.name) for row in rows if row.mark is mark]
        console.print(Text(f"{len(names)} {words}{': ' if names else ''}{listed(names)}"))
    console.print(
        f"The calibrations took {new.calibration / old.calibration:.2f} times as long; ratios are divided by that."
    )


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return the first ``most`` names, separated by commas."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def main(words: Sequence[str]) -> int:
    """Compare the first run with the second; return the exit code, 2 for wrong usage."""
    console = Console(width=None if sys.stdout.isatty() else 160, highlight=False)
    try:
        if len(words) != 2:
            raise BenchError("name the file of a run, and that of another or a folder of runs to compare it with.")
        new, other = read(Path(words[0])), Path(words[1])
        old = last_before(new, other) if other.is_dir() else read(other)
    except BenchError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    report(new, old, console)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
