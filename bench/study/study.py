"""A study as far as it has come, its points, and its file: JSON, written as a whole after every simulation."""

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import Any

from ...problems.catalog.atomic_file import replacing
from ...problems.errors import ProxbenchError
from ..errors import BenchError
from ..measure.machine import describe_machine
from ..store.records import printable
from .measuring import Measured
from .plan import Case, StudyPlan, plan_from
from .points import Point

KIND = "proxbench study of a simulation"
"""What a file says it is."""

FORMAT = 1
"""Version of the file."""

SUFFIX = ".json"

LARGEST_FILE = 2**26
"""Bytes that a study may have."""

Key = tuple[int, int]
"""Number of a case, and of a member of it."""


@dataclass(eq=False)
class Study:
    """A study as far as it has come.

    Attributes:
        plan: what is measured.
        file: where it is stored; nothing is if None.
        measured: what was, by number of the case and of the member.
        machine: what it is measured on.
    """

    plan: StudyPlan
    file: Path | None = None
    measured: dict[Key, Measured] = field(default_factory=dict)
    machine: Mapping[str, Any] = field(default_factory=describe_machine)

    @property
    def is_finished(self) -> bool:
        """Whether every member of every case is measured."""
        return len(self.measured) == self.plan.n_runs

    def members(self, number: int) -> dict[float, Measured]:
        """Return what was measured of the case with this number, by member."""
        case = self.plan.cases[number]
        found = {case.members[m]: self.measured.get((number, m)) for m in range(len(case.members))}
        return {member: one for member, one in found.items() if one is not None}

    def store(self) -> None:
        """Write the file as a whole or not at all.

        Raises:
            BenchError: if it cannot be written.
        """
        if self.file is None:
            return
        runs = [{"case": key[0], "member": key[1], **asdict(one)} for key, one in sorted(self.measured.items())]
        content = {
            "kind": KIND,
            "format": FORMAT,
            "version": metadata.version("proxbench"),
            "machine": self.machine,
            "plan": self.plan.document(),
            "runs": runs,
        }
        _write(self.file, json.dumps(content, indent=1, ensure_ascii=False))


def write_points(points: list[Point], file: Path) -> None:
    """Write points as a table of comma-separated values.

    Raises:
        BenchError: if the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, [one.name for one in fields(Point)])
    writer.writeheader()
    writer.writerows(asdict(point) for point in points)
    _write(file, text.getvalue())


def read_study(file: Path) -> Study:
    """Read a stored study.

    Raises:
        BenchError: if the file is missing, damaged, or no study.
    """
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise BenchError(f"{file} is too large for a study; name a file that proxbench simulate --study wrote.")
        content = printable(json.loads(file.read_bytes()))
    except FileNotFoundError:
        raise BenchError(f"there is no study {file}; name a file that proxbench simulate --study wrote.") from None
    except IsADirectoryError:
        raise BenchError(f"{file} is a folder; name a study in it, ending in {SUFFIX}.") from None
    except OSError as error:
        raise BenchError(f"cannot read {file}: {error.strerror}.") from None
    except (ValueError, RecursionError):
        raise _damaged(file) from None
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise BenchError(f"{file} holds no study; name a file that proxbench simulate --study wrote.")
    if content.get("format") != FORMAT:
        raise BenchError(f"{file} has format {content.get('format')}, this version reads format {FORMAT}; study anew.")
    try:
        plan = plan_from(content["plan"])
        measured = dict(_measured(entry, plan.cases) for entry in content["runs"])
        return Study(plan, file, measured, dict(content["machine"]))
    except ProxbenchError as error:
        raise BenchError(f"cannot go on from {file}: {error.sentence}") from None
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        raise _damaged(file) from None


def _measured(entry: Mapping[str, Any], cases: tuple[Case, ...]) -> tuple[Key, Measured]:
    known = {name: entry[name] for name in ("wall", "solves", "unsolved", "values", "failure")}
    key = entry["case"], entry["member"]
    numbers = [known["wall"], *known["values"].values()]
    whole = [*key, known["solves"], known["unsolved"]]
    if not all(type(number) is int and number >= 0 for number in whole) or not isinstance(known["failure"], str):
        raise ValueError("this is no measurement")
    if not all(type(number) in (int, float) and math.isfinite(number) for number in numbers):
        raise ValueError("this is no measurement")
    cases[key[0]].members[key[1]]
    return key, Measured(**known)


def _write(file: Path, text: str) -> None:
    try:
        with replacing(file) as opened:
            opened.write(text.encode())
    except OSError as error:
        raise BenchError(f"cannot write {file}: {error.strerror}; choose another --output.") from None


def _damaged(file: Path) -> BenchError:
    return BenchError(f"{file} is damaged; study anew.")
