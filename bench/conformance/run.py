"""``proxbench check``: run the conformance tests of a plugin in a child process."""

import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...problems.errors import suggestion
from ...problems.exchange.catalog import is_path, load, plugin_problems, problem_names
from ...problems.exchange.plugins.files import PluginFile
from ...problems.exchange.plugins.offers import forget, registered
from ...solvers.registry import available, compiled_solvers, composites, natives, on_devices, peers, plugin_solvers
from ..errors import BenchError
from ..isolation.worker import Fault, RenewedWorker
from ..plugins.descriptions import solver_spec
from ..plugins.files import use_plugin_files
from ..plugins.native_files import is_native
from ..report.layout.text import output_width
from ..store.outcome import Outcome
from .task import CHECKS, CheckingTask

CHECK_SECONDS = 60.0
"""Time limit of one check [s]."""

MEMORY_BYTES = 2**31
"""Memory limit of checks, in addition to the memory that the framework needs [bytes]."""

RESULTS = ("passed", "failed", "not applicable")
"""Possible results of a check."""

OnCheck = Callable[[str, int, int], None]
"""Called before each check with ``"SUBJECT: CHECK"``, the number of finished checks, and the number of all checks."""


def run_checks(
    target: str, seconds: float = CHECK_SECONDS, on_check: OnCheck = lambda what, done, total: None
) -> list[dict[str, Any]]:
    """Run all conformance tests on a solver or problem, or on all solvers and problems of a plugin file.

    Args:
        target: a name, with or without options, or the path of a plugin file or problem file.
        seconds: time limit of one check [s].
        on_check: called before every check, to show the progress.

    Returns:
        For each solver or problem, a dict with kind, name, source, passed and checks. Each check is a dict with
        check, promise, result ("passed", "failed" or "not applicable"), sentence and seconds.

    Raises:
        ProxbenchError: for an unknown name, a time limit that is not positive, or a plugin that provides neither
            solvers nor problems.
    """
    if not seconds > 0:
        raise BenchError(f"`seconds` must be positive, got {seconds:g}; omit it for the default.")
    file = PluginFile.read(target) if _is_plugin_path(target) else None
    registered_before = [plugin_file for plugin_file, _ in registered()]
    try:
        subjects = _subjects_by_name(target) if file is None else _subjects_of_file(file, seconds)
        with RenewedWorker(CheckingTask(), seconds, MEMORY_BYTES, _compiled_solvers(subjects)) as worker:
            return [_check_subject(worker, subject, on_check) for subject in subjects]
    finally:
        if file is not None and file not in registered_before:
            forget(file)


def _is_plugin_path(target: str) -> bool:
    """Return whether a target is a plugin file. Any other existing file counts as one, so that reading it fails.

    Raises:
        BenchError: if it is a shared library or a program.
    """
    if is_path(target):
        return False
    if is_native(Path(target)):
        raise BenchError(
            f"{target} is a shared library or a program; check its solver as 'Shared({target})' or "
            f"'Executable({target})'."
        )
    return target.endswith(".py") or "/" in target.partition("(")[0] or Path(target).is_file()


def print_checks(subjects: list[dict[str, Any]], failed_only: bool = False) -> None:
    """Print the checks of each subject, with a sentence for each failure, and a summary line.

    ``failed_only`` omits subjects and checks that did not fail.
    """
    columns = output_width()
    for subject in subjects:
        rows = [row for row in subject["checks"] if not failed_only or row["result"] == "failed"]
        if not rows:
            continue
        origin = f" from {subject['source']}" if subject["source"] else ""
        print(f"{subject['kind']} {subject['name']}{origin}")
        width = max(len(row["check"]) for row in rows)
        for row in rows:
            start = f"  {row['check']:<{width}}  {row['result']:<14}  "
            text = textwrap.fill(
                row["sentence"] or "-",
                columns,
                initial_indent=start,
                subsequent_indent=" " * len(start),
                break_on_hyphens=False,
                break_long_words=False,
            )
            print(text if row["sentence"] else start.rstrip())
        results = [row["result"] for row in subject["checks"]]
        counts = [f"{results.count(result)} {result}" for result in RESULTS if result in results]
        print(f"  {', '.join(counts)}\n")


def _subjects_of_file(file: PluginFile, seconds: float) -> list[dict[str, str]]:
    """Register a plugin file for child processes, and return kind, name and source of its solvers and problems."""
    use_plugin_files([file.path], seconds)
    offers = [offer for offer in (*plugin_solvers(), *plugin_problems()) if offer.file == file]
    if not offers:
        raise BenchError(f"{file.source} provides only scenes, which are not checked; run `proxbench simulate`.")
    return [{"kind": offer.kind, "name": offer.name, "source": offer.source} for offer in offers]


def _subjects_by_name(target: str) -> list[dict[str, str]]:
    """Return kind, name and source of the solver or problem called ``target``."""
    if target.partition("(")[0].strip() in (*available(), *composites(), *peers(), *on_devices(), *natives()):
        solver = solver_spec(target)
        return [{"kind": "solver", "name": solver.name, "source": solver.source}]
    if is_path(target):
        load(target)  # raises an error that describes the fault of the file
        return [{"kind": "problem", "name": target, "source": ""}]
    known = problem_names()
    if target not in known:
        raise BenchError(
            f"there is no solver or problem {target!r}{suggestion(target, [*available(), *known], 'proxbench list')}"
        )
    source = next((offer.source for offer in plugin_problems() if offer.name == target), "")
    if not source:
        load(target)  # raises an error that explains how to generate a missing problem
    return [{"kind": "problem", "name": target, "source": source}]


def _compiled_solvers(subjects: list[dict[str, str]]) -> list[str]:
    """Return the built-in solvers whose kernels the subjects use; all of them if one is a solver of a plugin."""
    solvers = [subject for subject in subjects if subject["kind"] == "solver"]
    if any(subject["source"] for subject in solvers):
        return compiled_solvers()
    return [name for subject in solvers for name in compiled_solvers(subject["name"])]


def _check_subject(worker: RenewedWorker, subject: dict[str, str], on_check: OnCheck) -> dict[str, Any]:
    """Run all checks of a subject, and return their results as ``run_checks`` describes them."""
    rows: list[dict[str, Any]] = []
    checks = CHECKS[subject["kind"]]
    for check in checks:
        on_check(f"{subject['name']}: {check.name}", len(rows), len(checks))
        start_time = time.perf_counter()
        try:
            answer, _ = worker.ask("check", subject["kind"], subject["name"], check.name)
        except Fault as fault:
            late = f"it did not finish within {worker.seconds:g} s."
            sentence = late if fault.outcome is Outcome.TIMEOUT else f"{fault.reason}."
            answer = {"result": "failed", "sentence": sentence}
        seconds = round(time.perf_counter() - start_time, 3)
        rows.append({"check": check.name, "promise": check.promise, **answer, "seconds": seconds})
    return {**subject, "passed": all(row["result"] != "failed" for row in rows), "checks": rows}
