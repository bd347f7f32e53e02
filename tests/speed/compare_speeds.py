"""Speeds of one run of this suite against another, with the speed of the machine taken out.

    ratio = (median / median before) / (calibration / calibration before)

``python tests/speed/compare_speeds.py NEW.json OLD`` prints them as a table; where OLD is a folder, it takes the run
that was measured last before NEW among its files.
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

from proxbench.bench.errors import BenchError
from rich.console import Console
from rich.table import Table
from rich.text import Text

CALIBRATION = "test_calibration"
"""How the names of those benchmarks begin whose ratio all others are divided by."""

SLOWER = 1.3
"""Ratio above which a benchmark is marked as slower; below its inverse it is marked as faster."""


DISTURBED = 0.3
"""Cores that other programs kept busy in one of two runs only, from which on a difference may be their doing."""


class Mark(StrEnum):
    """What became of a benchmark."""

    SAME = ""
    SLOWER = "slower"
    FASTER = "faster"
    DISTURBED = "disturbed"
    NEW = "new"
    GONE = "gone"
    OTHER = "another problem"


@dataclass(frozen=True)
class Speeds:
    """One stored run.

    Attributes:
        path: its file.
        taken: when it was measured.
        machine: processor and version of Python, which ratios presume to be the same.
        medians: median time [s] of each benchmark, by its name with the file.
        extra: what else each benchmark noted (``digest``, ``iterations``, …).
    """

    path: Path
    taken: datetime
    machine: str
    medians: dict[str, float]
    extra: dict[str, dict[str, Any]] = field(default_factory=dict)

    @property
    def calibration(self) -> float:
        """Geometric mean of the calibrations [s], which are spread over the run."""
        return geometric_mean([seconds for name, seconds in self.medians.items() if is_calibration(name)])

    def load_of_others(self, name: str) -> float:
        """Cores that other programs kept busy during a benchmark, 0 where it was not noted."""
        return float(self.extra[name].get("load_of_others", 0.0))


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: name of the benchmark, with its file.
        median: median time [s] now, or before for one that is gone.
        ratio: the calibrated ratio, None where there is none.
        mark: what became of it.
        note: what else it noted.
    """

    name: str
    median: float
    ratio: float | None
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
            {entry["fullname"]: float(entry["stats"]["median"]) for entry in document["benchmarks"]},
            {entry["fullname"]: entry["extra_info"] for entry in document["benchmarks"]},
        )
    except OSError as error:
        raise BenchError(f"{path} cannot be read ({error.strerror}); nox -s speed writes such files.") from None
    except (ValueError, KeyError, TypeError):
        raise BenchError(f"{path} holds no speeds; it must be what nox -s speed writes.") from None
    if not all(0.0 < seconds < float("inf") for seconds in speeds.medians.values()):
        raise BenchError(f"{path} holds a time that is not positive; it must be what nox -s speed writes.")
    if not any(map(is_calibration, speeds.medians)):
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
    machine = new.calibration / old.calibration if old else 1.0
    before = old.medians if old else {}
    rows = []
    for name, median in new.medians.items():
        ratio, mark = None, Mark.NEW
        if old and name in before:
            if new.extra[name].get("digest") != old.extra[name].get("digest"):
                mark = Mark.OTHER
            elif is_calibration(name):  # its ratio is the machine's, which is no merit or fault
                ratio, mark = median / before[name], Mark.SAME
            else:
                ratio = median / before[name] / machine
                mark = marked(ratio, new.load_of_others(name) - old.load_of_others(name))
        rows.append(Row(name, median, ratio, mark, noted(new.extra[name])))
    for name, median in before.items():
        if name not in new.medians:
            rows.append(Row(name, median, None, Mark.GONE, ""))
    return rows


def marked(ratio: float, more_load: float) -> Mark:
    """Return the mark that a ratio deserves, if other programs kept ``more_load`` cores more busy than before."""
    if ratio > SLOWER:
        return Mark.DISTURBED if more_load > DISTURBED else Mark.SLOWER
    if ratio < 1.0 / SLOWER:
        return Mark.DISTURBED if more_load < -DISTURBED else Mark.FASTER
    return Mark.SAME


def noted(extra: dict[str, Any]) -> str:
    """Return what a benchmark noted in words, without what is for programs."""
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
    """Say whether a benchmark measures the machine."""
    return name.rpartition("::")[2].startswith(CALIBRATION)


def shown(seconds: float) -> str:
    """Return a time with a unit that suits it."""
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def table(rows: Sequence[Row], title: str) -> Table:
    """Return the rows as a table for a terminal."""
    drawn = Table(title=title, box=None, padding=(0, 1))
    for column in ("name", "median", "ratio", "", "note"):
        drawn.add_column(column, justify="right" if column in ("median", "ratio") else "left", overflow="fold")
    colours = {Mark.SLOWER: "bold red", Mark.FASTER: "green"}
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.2f}"
        cells = (short(row.name), shown(row.median), ratio, row.mark, row.note)
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
        console.print(f"Another machine: {old.machine} before, {new.machine} now; ratios hold roughly at best.")
    for mark, words in (
        (Mark.GONE, "measured before and not now"),
        (Mark.DISTURBED, "disturbed by other programs in one of the runs"),
        (Mark.SLOWER, f"slower than {SLOWER} times"),
    ):
        names = [short(row.name) for row in rows if row.mark is mark]
        console.print(Text(f"{len(names)} {words}{': ' if names else ''}{listed(names)}"))
    console.print(f"The machine took {new.calibration / old.calibration:.2f} times as long; ratios are free of that.")


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return names with commas, the first ``most`` of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def main(words: Sequence[str]) -> int:
    """Compare the run named first with that named second; return the exit code, 2 for wrong usage."""
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
