"""Make small changes to the code, one at a time, and list those that no daily test notices.

``nox -s mutants`` runs this in a copy of the repository that is installed in place. Cosmic Ray makes the changes: other
operators and comparisons, numbers off by one, loops without iterations, exceptions that are not caught. Changes of
annotations, decorators and numbers outside functions are skipped: no test can notice the first two, and the last are
mostly tuned limits. A change is noticed if a daily test fails or times out. Tests of the same name run first, then
those of the same folder, then those in ``WIDER``.

Tests run in copies of a process that has imported the libraries, so that a change takes little more time than its
tests. Kernels run without numba's compiler, whose cache does not notice changes in the functions that a kernel calls.
The tests run once without a change, and those that fail or are slow in pure Python are skipped.

    python tests/mutants.py --sample 20 --seed 1 problems/contact bench/store
"""

import argparse
import ast
import contextlib
import difflib
import json
import os
import random
import re
import signal
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hypothesis  # noqa: F401
import numba
import numpy as np
import pandas  # noqa: F401
import pytest
import scipy.linalg
import scipy.optimize
import scipy.sparse.linalg  # noqa: F401

ROOMS = (
    "problems/contact",
    "problems/motion/stepping",
    "problems/motion/bodies",
    "problems/motion/detection",
    "solvers/sweeps",
    "bench/store",
    "bench/measure",
    "bench/isolation",
)
"""The folders that are changed by default."""

WIDER = {
    "problems/contact": ("tests/problems/hard",),
    "problems/motion/bodies": ("tests/problems/motion/scenes",),
    "problems/motion/detection": ("tests/problems/motion/bodies",),
    "problems/motion/stepping": ("tests/problems/motion/scenes",),
    "solvers/sweeps": ("tests/solvers/prox", "tests/solvers/iteration"),
    "solvers": ("tests/solvers",),
    "bench/isolation": ("tests/bench/measure/contacts",),
    "bench/measure": ("tests/bench/measure",),
    "bench/store": ("tests/bench/store",),
}
"""Tests of other folders that cover a folder."""

LEFT_OUT = re.compile(
    r"RemoveDecorator|BinaryOperator_BitOr|BinaryOperator_.*_(BitAnd|BitOr|BitXor|LShift|RShift|Mod)$"
    r"|ComparisonOperator_(Lt|LtE|Gt|GtE|Eq|NotEq|In|NotIn)_(Is|IsNot|In|NotIn)$"
)
"""Operators without an effect, such as unions of types, and implausible mistakes with numbers."""

TEST_SECONDS = 20.0
"""Default time limit of one test without its fixtures [s]; tests that take more than half of it are skipped."""

MAX_SLOWDOWN = 5.0
"""Time of all tests with a change, relative to the time without it, from which they time out."""

MIN_RUN_SECONDS = 60.0
"""Minimum of the time limit of all tests of a change [s]."""

POLL_SECONDS = 0.02
"""Interval at which running tests are polled [s]."""

RESULTS = Path("mutants.jsonl")
"""Known results, one change per line; noticed changes are not tried again. Delete the file to start anew."""


@dataclass(frozen=True)
class Tests:
    """The daily tests that cover a folder.

    Attributes:
        folders: the mirrored folder, then wider ones.
        is_compiled: whether numba may compile; false if a module has its own kernels.
        seconds: time limit of each test without its fixtures [s].
    """

    folders: tuple[str, ...]
    is_compiled: bool
    seconds: float

    @staticmethod
    def of(module: Path, seconds: float) -> "Tests":
        """Return the tests of the folder of a module."""
        folder = Path("tests") / module.parent
        while not folder.is_dir():
            folder = folder.parent
        wider = [path for room, paths in WIDER.items() if module.is_relative_to(room) for path in paths]
        return Tests(tuple(dict.fromkeys([str(folder), *wider])), "njit" not in module.read_text(), seconds)

    def arguments(self, *options: str) -> list[str]:
        """Return the arguments with which pytest runs them."""
        timing = (f"--timeout={self.seconds}", "-o", "timeout_func_only=true", "-o", "junit_duration_report=call")
        fixed = ("-q", "-p", "no:cacheprovider", "-m", "not slow", *timing)
        return [*fixed, *options, *self.folders]

    def environment(self) -> dict[str, str]:
        """Return the environment in which the tests run."""
        is_disabled = "0" if self.is_compiled else "1"
        fixed = {"PYTHONPATH": "tests", "PYTHONDONTWRITEBYTECODE": "1", "NUMBA_DISABLE_JIT": is_disabled}
        return {**os.environ, **fixed}


def run(tests: Tests, options: Sequence[str], seconds: float = np.inf) -> int | None:
    """Run tests in a copy of this process, which has imported the libraries already.

    Returns:
        The exit code of pytest; None if it takes longer than ``seconds``.
    """
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.setsid()
            silence = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(silence, stream)
            os.environ.update(tests.environment())
            numba.config.DISABLE_JIT = 0 if tests.is_compiled else 1
            status = int(pytest.main(tests.arguments(*options)))
        finally:
            os._exit(status)
    end, status = time.monotonic() + seconds, None
    while status is None and time.monotonic() < end:
        ended, found = os.waitpid(child, os.WNOHANG)
        status = os.waitstatus_to_exitcode(found) if ended else time.sleep(POLL_SECONDS)
    with contextlib.suppress(ProcessLookupError):  # the processes have already ended
        os.killpg(child, signal.SIGKILL)
    if status is None:
        os.waitpid(child, 0)
    return status


@dataclass(frozen=True)
class Baseline:
    """Results of tests without any change.

    Attributes:
        left_out: names of the tests that fail or take too long.
        seconds: wall time of all tests [s].
    """

    left_out: list[str]
    seconds: float


def measured_baseline(tests: Tests) -> Baseline:
    """Run tests without any change."""
    report, seconds = Path("mutants.xml"), 0.0
    for _ in range(2 if tests.is_compiled else 1):  # the first time may compile
        began = time.monotonic()
        run(tests, [f"--junitxml={report}"])
        seconds = time.monotonic() - began
    left_out = [
        f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"
        for case in ElementTree.parse(report).iter("testcase")
        if float(case.get("time", 0.0)) > tests.seconds / 2
        or any(case.find(tag) is not None for tag in ("failure", "error"))
    ]
    report.unlink()
    return Baseline(left_out, seconds)


def ineffective_lines(module: Path) -> set[int]:
    """Return the lines of a module outside the code of functions and methods: annotations, constants, decorators."""
    tree = ast.parse(module.read_text())
    lines = set(range(1, len(module.read_text().splitlines()) + 1))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            for statement in node.body:
                lines -= set(range(statement.lineno, (statement.end_lineno or statement.lineno) + 1))
    return lines


def changes(room: str) -> Iterator[Any]:
    """Yield the mutations of a folder or file that may have an effect."""
    from cosmic_ray.commands.init import init
    from cosmic_ray.work_db import WorkDB, use_db

    files = [Path(room)] if room.endswith(".py") else sorted(Path(room).rglob("*.py"))
    skipped = {path: ineffective_lines(path) for path in files}
    with use_db(":memory:", WorkDB.Mode.create) as database:
        init(files, database, {})
        for item in database.work_items:
            (mutation,) = item.mutations
            is_effective = mutation.start_pos[0] not in skipped[mutation.module_path]
            if is_effective and not LEFT_OUT.search(mutation.operator_name):
                yield mutation


def sampled(every: list[Any], sample: int | None, seed: int) -> list[Any]:
    """Return one change at each of ``sample`` random places, or all changes at all places."""
    if sample is None:
        return every
    places: dict[tuple[Any, ...], list[Any]] = {}
    for one in every:
        places.setdefault((str(one.module_path), one.start_pos, one.operator_name.split("_")[0]), []).append(one)
    chance = random.Random(seed)
    return [chance.choice(places[place]) for place in chance.sample(sorted(places), min(sample, len(places)))]


def is_noticed(mutation: Any, test_seconds: float, baselines: dict[Tests, Baseline]) -> tuple[bool, str]:
    """Return whether the tests notice a change, and the change as a patch."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    module = mutation.module_path
    tests = Tests.of(module, test_seconds)
    if tests not in baselines:
        baselines[tests] = measured_baseline(tests)
        print(f"without {len(baselines[tests].left_out)} tests: {', '.join(tests.folders)}", flush=True)
    baseline = baselines[tests]
    nearest = map(str, Path(tests.folders[0]).rglob(f"test_{module.stem}*.py"))
    options = ["-x", *nearest, *(f"--deselect={test}" for test in baseline.left_out)]
    text = module.read_text()
    operator = get_operator(mutation.operator_name)(**mutation.operator_args)
    changed = mutate_code(text, operator, mutation.occurrence)
    try:
        module.write_text(changed)
        status = run(tests, options, max(MIN_RUN_SECONDS, MAX_SLOWDOWN * baseline.seconds))
    finally:
        module.write_text(text)
    lines = difflib.unified_diff(text.splitlines(), changed.splitlines(), str(module), str(module), lineterm="")
    return status != 0, "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Try changes; print those that no test notices, and the share of noticed ones by folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="*", default=ROOMS, help="folders or files to change")
    parser.add_argument("--sample", type=int, default=None, help="places of each room, chosen at random; all without")
    parser.add_argument("--seed", type=int, default=0, help="of the choice")
    parser.add_argument("--test-seconds", type=float, default=TEST_SECONDS, help="time limit of one test [s]")
    given = parser.parse_args(arguments)
    sys.dont_write_bytecode = True  # a change within a second keeps the time of a file
    known = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []
    found, baselines = {one["key"]: one for one in known}, dict[Tests, Baseline]()
    counts = dict[str, list[bool]]()
    for room in given.rooms:
        chosen = sampled(list(changes(room)), given.sample, given.seed)
        for mutation in sorted(chosen, key=lambda one: (str(one.module_path), one.start_pos)):
            key = f"{mutation.module_path}:{mutation.start_pos[0]} {mutation.operator_name} {mutation.occurrence}"
            if not found.get(key, {}).get("is_noticed"):  # unnoticed changes may have a new test
                noticed, diff = is_noticed(mutation, given.test_seconds, baselines)
                found[key] = {"key": key, "is_noticed": noticed, "diff": diff}
                with RESULTS.open("a") as file:
                    file.write(json.dumps(found[key]) + "\n")
            one = found[key]
            counts.setdefault(room, []).append(one["is_noticed"])
            print(f"noticed: {key}" if one["is_noticed"] else f"NOT NOTICED: {key}\n{one['diff']}", flush=True)
    for room, noticed_ones in counts.items():
        print(f"{room}: {sum(noticed_ones)} of {len(noticed_ones)} noticed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
