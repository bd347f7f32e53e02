"""Compare twelve speeds of the installed package with those of accepted commits, side by side.

``python tests/speed/pair.py`` installs the last base of ``results/speed/accepted.toml``, and commits that accept a
figure by name, into ``build/speed``, without their dependencies. Two processes on one core, one with each state, repeat
a figure in turn. The ratio of a figure is the median over pairs of processor times, each of ``SAMPLE_SECONDS``.
``ROUNDS`` pairs come from each of up to ``GENERATIONS`` pairs of processes, because processes that run the same program
differ by some per cent. A figure is slower if the whole interval of its ratio is above ``SLOWER``.

Each state is measured by its own ``figures.py``, so that names may change. A figure whose work changes must get a new
name. Each base has a reason, and earlier ones stay in the file, so that it shows how changes below ``SLOWER`` add up.
The exit code is 1 if a figure is slower, 2 if something is wrong, and 0 otherwise, even if a commit is not available.
``python tests/speed/pair.py COMMIT`` compares all figures with one commit, given by any name that git accepts.

``--store`` adds the speeds and ratios of the checked-out commit to ``results/speed/history.csv``, for releases.
"""

import argparse
import io
import json
import math
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
from figures import FIGURES, pour
from proxbench.bench.errors import BenchError
from proxbench.bench.isolation.fork_server import ONE_THREAD
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.report.cells import duration
from proxbench.bench.store.ratios import Ratio, bootstrap_ratio

ROOT = Path(__file__).parents[2]
ACCEPTED = ROOT / "results" / "speed" / "accepted.toml"
HISTORY = ROOT / "results" / "speed" / "history.csv"
STATES = ROOT / "build" / "speed"
FIGURES_FILE = "tests/speed/figures.py"

SLOWER = 1.15
"""Ratio above which a figure is slower."""

SAMPLE_SECONDS = 0.02
"""Processor time of one sample [s]."""

ROUNDS, GENERATIONS = 20, 5
"""Number of pairs of samples per pair of processes, and largest number of pairs of processes; the later ones measure
undecided figures."""


STEADY = {"PYTHONHASHSEED": "0", "MALLOC_TRIM_THRESHOLD_": "1000000000", "MALLOC_MMAP_THRESHOLD_": "1000000000"}
"""Environment in which equal processes differ less: glibc returns no memory that must be mapped again."""


class UnknownCommitError(BenchError):
    """The clone does not contain a commit."""


@dataclass
class Comparison:
    """One figure and the measurements of its ratio.

    Attributes:
        figure: its name.
        commit: the state that it is compared with.
        logarithms: log(new / old) of each pair of samples.
        seconds: processor time of one repetition now [s].
        missing: why ``commit`` does not have the figure, empty if it does.
    """

    figure: str
    commit: str
    logarithms: list[float] = field(default_factory=list)
    seconds: float = math.nan
    missing: str = ""

    @property
    def ratio(self) -> Ratio:
        """The ratio of times, new over old, with its interval."""
        return bootstrap_ratio(np.array(self.logarithms))

    @property
    def is_slower(self) -> bool:
        """Whether the figure is slower beyond doubt."""
        return not self.missing and self.ratio.low > SLOWER

    @property
    def is_decided(self) -> bool:
        """Whether the figure needs no further measurement; a slower one must be slower in two pairs of processes."""
        is_confirmed = self.is_slower and len(self.logarithms) > ROUNDS
        return bool(self.missing) or self.ratio.high < SLOWER or is_confirmed

    @property
    def verdict(self) -> str:
        """One of "slower", "faster" and "undecided"; empty if the ratio is within ``SLOWER``."""
        if self.is_slower:
            return "slower"
        if not self.is_decided:
            return "undecided"
        return "faster" if self.ratio.high < 1.0 / SLOWER else ""


class PackageProcess:
    """A process with one state of the package, whose figures it measures by commands."""

    def __init__(self, site: Path | None, figures: Path, folder: Path) -> None:
        environment = os.environ | ONE_THREAD | STEADY
        environment.pop("PYTHONPATH", None)
        if site is not None:
            environment |= {"PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(site / "numba")}
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(figures), str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=folder,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def send(self, cores: Iterable[int], *command: object) -> None:
        """Send a command, to run on one of ``cores``."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError, ProcessLookupError):
            os.sched_setaffinity(self._process.pid, cores)
            print(json.dumps(command), file=self._process.stdin, flush=True)

    def receive(self) -> dict[str, Any]:
        """Return the answer to the last command; a process that has ended has no figure."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return json.loads(line) if line else {"missing": "its process has ended"}


def accepted(path: Path) -> tuple[list[Comparison], list[str]]:
    """Return each figure with the commit that it is compared with, and the commits of all bases, the first one first.

    Raises:
        BenchError: if the file cannot be read, names an unknown figure, or accepts a base or a figure without a reason.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        changed = document.get("accepted", {})
        bases = [entry["commit"] for entry in document["bases"] if entry["reason"].strip()]
        commits = {figure: entry["commit"] for figure, entry in changed.items() if entry["reason"].strip()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BenchError(f"{path} must have a commit and a reason for each base and figure ({error}).") from None
    if not bases or len(bases) < len(document["bases"]):
        raise BenchError(f"{path} must have at least one base, and a reason for each.")
    for figure in changed:
        if figure not in commits or figure not in FIGURES:
            raise BenchError(f"{path} accepts {figure!r}, which is no figure or has no reason; figures are {names()}.")
    return [Comparison(figure, commits.get(figure, bases[-1])) for figure in FIGURES], bases


def names() -> str:
    """Return the names of all figures."""
    return ", ".join(FIGURES)


def commit_hash(name: str) -> str:
    """Return the full hash of a commit, given by any name that git accepts, such as a branch.

    Raises:
        UnknownCommitError: if the clone does not contain it.
    """
    words = ["git", "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}"]
    found = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    if found.returncode:
        raise UnknownCommitError(f"commit {name} is not in this clone; git fetch --unshallow brings it.")
    return found.stdout.strip()


def archived(commit: str) -> bytes:
    """Return the files of a commit as a tar archive."""
    return subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout


def install(commit: str) -> Path:
    """Return the folder with the package at a commit, given by its hash; install it there if it is missing.

    Raises:
        BenchError: if the package cannot be installed.
    """
    site, files = STATES / commit, archived(commit)
    if site.is_dir():
        return site
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(fileobj=io.BytesIO(files)) as archive:
            safe = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # since Python 3.11.4
            archive.extractall(folder, **safe)  # type: ignore[arg-type]
        partial = Path(folder, "site")
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-compile", "--target", str(partial)]
        version = {"SETUPTOOLS_SCM_PRETEND_VERSION": "0"}
        done = subprocess.run([*pip, folder], env=os.environ | version, capture_output=True, text=True)
        if done.returncode:
            raise BenchError(f"commit {commit} cannot be installed: {done.stderr.strip()[-500:]}")
        if Path(folder, FIGURES_FILE).exists():
            shutil.copy(Path(folder, FIGURES_FILE), partial)
        STATES.mkdir(parents=True, exist_ok=True)
        shutil.move(partial, site)
    return site


def measure(comparisons: Sequence[Comparison], site: Path, folder: Path) -> None:
    """Add ``ROUNDS`` pairs to comparisons with one state, from one pair of processes.

    Raises:
        BenchError: if the installed package does not have a figure.
    """
    cores = os.sched_getaffinity(0)
    figures = site / Path(FIGURES_FILE).name
    with ExitStack() as stack:
        new = stack.enter_context(PackageProcess(None, ROOT / FIGURES_FILE, folder))
        old = stack.enter_context(PackageProcess(site, figures if figures.exists() else ROOT / FIGURES_FILE, folder))
        for comparison in comparisons:
            for process in (new, old):
                process.send(cores, "prepare", comparison.figure)
            first, second = new.receive(), old.receive()
            if "missing" in first:
                raise BenchError(f"the figure {comparison.figure!r} fails: {first['missing']}.")
            comparison.missing = second.get("missing", "")
            if comparison.missing:
                continue
            count = max(1, round(SAMPLE_SECONDS / min(first["seconds"], second["seconds"])))
            for turn in range(ROUNDS):
                times = {}
                for process in (new, old) if turn % 2 else (old, new):
                    process.send([max(cores)], "run", comparison.figure, count)
                    times[process] = process.receive()["seconds"]
                comparison.logarithms.append(math.log(times[new] / times[old]))
                comparison.seconds = times[new]


def line(comparison: Comparison) -> str:
    """Return a line of the table."""
    compared = f"new, {comparison.commit:.8} has no such figure ({comparison.missing})"
    if not comparison.missing:
        value, low, high = comparison.ratio
        compared = f"{value:5.2f}   {low:.2f} to {high:.2f}   {comparison.commit:.8}   {comparison.verdict}"
    return f"{comparison.figure:34}{duration(comparison.seconds):>9}   {compared}".rstrip()


def compare(comparisons: list[Comparison]) -> int:
    """Measure and print all comparisons; return the exit code."""
    print(f"{'figure':34}{'now':>9}   ratio   interval       against")
    with tempfile.TemporaryDirectory() as folder:
        pour(Path(folder))
        for name in dict.fromkeys(comparison.commit for comparison in comparisons):
            left = [comparison for comparison in comparisons if comparison.commit == name]
            try:
                commit = commit_hash(name)
            except UnknownCommitError as error:
                print(f"Skipped: {error}")
                continue
            if not commit.startswith(name):
                print(f"{name} is commit {commit}.")
            for comparison in left:
                comparison.commit = commit
            site = install(commit)
            for _ in range(GENERATIONS):
                measure(left, site, Path(folder))
                left = [comparison for comparison in left if not comparison.is_decided]
                if not left:
                    break
    measured = [comparison for comparison in comparisons if comparison.logarithms or comparison.missing]
    print(*map(line, measured), sep="\n")
    slower = [comparison.figure for comparison in measured if comparison.is_slower]
    if not slower:
        compared = sum(bool(comparison.logarithms) for comparison in comparisons)
        undecided = sum(not comparison.is_decided for comparison in measured)
        rest = f"; {undecided} {'is' if undecided == 1 else 'are'} undecided." if undecided else "."
        print(f"None of {compared} compared figures is certainly slower than {SLOWER} times{rest}")
        return 0
    print(
        f"Slower than {SLOWER} times: {', '.join(slower)}. Make them fast again, or accept them by name in "
        f"{ACCEPTED.relative_to(ROOT)}:"
    )
    for figure in slower:
        print(f'\n[accepted."{figure}"]\ncommit = "COMMIT THAT IS SLOWER"\nreason = "…"')
    return 1


def measured_commit() -> str:
    """Return the hash of the checked-out commit.

    Raises:
        BenchError: if files differ from it, so that the measured state is not that of the commit.
    """
    words = ["git", "status", "--porcelain", "--untracked-files=no", "--", ":/", ":(exclude,top)results"]
    changes = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    if changes:
        raise BenchError(f"{changes[0][3:]} has changes; speeds are stored by commit, so commit them first.")
    return commit_hash("HEAD")


def store(comparisons: Iterable[Comparison], commit: str, path: Path) -> None:
    """Append a row for each compared figure to a CSV file, which is created if it is missing."""
    processor = this_machine().processor
    rows = [
        {
            "date": date.today().isoformat(),
            "commit": commit,
            "processor": processor,
            "figure": comparison.figure,
            "seconds": comparison.seconds,
            "base": comparison.commit,
            **dict(zip(("ratio", "low", "high"), comparison.ratio, strict=True)),
        }
        for comparison in comparisons
        if comparison.logarithms
    ]
    pd.DataFrame(rows).to_csv(path, mode="a", header=not path.exists(), index=False, float_format="%.4g")


def main(words: Sequence[str]) -> int:
    """Compare with the accepted commits, or with the one that is named; return the exit code.

    Raises:
        SystemExit: with code 2 for wrong arguments, with code 0 for ``--help``.
    """
    parser = argparse.ArgumentParser(prog="python tests/speed/pair.py", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "commit", nargs="?", metavar="COMMIT", help="state to compare with; by default, the accepted ones"
    )
    parser.add_argument("--store", action="store_true", help="add the speeds to results/speed/history.csv")
    given = parser.parse_args(words)
    try:
        commit = measured_commit() if given.store else ""
        if given.commit:
            comparisons, bases = [Comparison(figure, given.commit) for figure in FIGURES], [given.commit]
        else:
            comparisons, bases = accepted(ACCEPTED)
        code = compare(comparisons)
        if given.store:
            store(comparisons, commit, HISTORY)
        if len(bases) > 1:
            count, first = len(bases) - 1, bases[0][:8]
            print(f"Earlier bases: {count}; python tests/speed/pair.py {first} compares with the first one.")
        return code
    except BenchError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
