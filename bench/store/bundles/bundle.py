"""Runs as single files, with the problems that the package does not contain.

A bundle is one JSON document with a checksum, compressed by gzip. It may come from an untrusted source: it contains no
code and no paths, and reading checks that its parts are consistent. ``rejudge`` checks whether its residuals are true.
"""

import gzip
import io
import os
from dataclasses import dataclass
from pathlib import Path

from ....problems.contact.judge import JUDGE
from ....problems.contact.problem import ContactProblem
from ....problems.exchange.catalog import is_shipped, load
from ....problems.exchange.files.problem_file import packed_problem, read_problem
from ...errors import BenchError
from ..conversion import decode_record, decompress, encode_record
from ..fields import Record
from ..records import CaseRecord, RunRecord
from ..store import BUNDLE_SUFFIX, Store, is_bundle, put_file

MAX_BYTES = 2**30
"""Largest size of an unpacked bundle [bytes]."""

_REMEDY = "get it again from its source"
"""Remedy for a damaged bundle."""

_GZIP = b"\x1f\x8b"
"""First bytes of a bundle."""


class _Content(Record, frozen=True, kw_only=True):
    """The document of a bundle; ``problems`` are files as ``save_problem`` writes them."""

    run: RunRecord
    cases: list[CaseRecord]
    problems: list[bytes]


@dataclass(frozen=True)
class Bundle:
    """The content of a bundle, or of a run to be packed.

    Attributes:
        source: its file, or the folder of the run.
        run: plan and machines.
        cases: the measured cases.
        carried: the problems that the package does not contain, by name.
    """

    source: Path
    run: RunRecord
    cases: list[CaseRecord]
    carried: dict[str, ContactProblem]

    def problem(self, name: str) -> ContactProblem:
        """Return a problem of the run from the package if it has one of that name, else from the bundle.

        Raises:
            BenchError: if neither has the problem, or the two differ.
        """
        carried = self.carried.get(name)
        if not is_shipped(name):
            if carried is None:
                raise BenchError(f"the problem {name!r} is neither in {self.source} nor in this package.")
            return carried
        shipped = load(name)
        if carried is not None and carried.digest != shipped.digest:
            raise BenchError(
                f"the problem {name!r} of {self.source} differs from that of this package; "
                "rename it and measure it again."
            )
        return shipped

    def read_run(self) -> RunRecord:
        """Return the record of the run, as ``Store.read_run`` does."""
        return self.run

    def read_cases(self, problem: str | None = None) -> tuple[list[CaseRecord], list[str]]:
        """Return all cases, or those of one problem, and an empty list of damaged files; see ``Store.read_cases``."""
        return [case for case in self.cases if problem in (None, case.problem)], []

    def read_problem(self, digest: str) -> ContactProblem:
        """Return a problem in the bundle by its digest, as ``Store.read_problem`` does."""
        return next(problem for problem in self.carried.values() if problem.digest == digest)


def open_run(path: Path) -> Store | Bundle:
    """Open the folder or the bundle of a run.

    Raises:
        BenchError: if the path is neither, or the bundle is damaged.
    """
    return read_bundle(path) if is_bundle(path) else Store.open(path)


def output_folder(path: Path) -> Path:
    """Return the folder for the tables, charts and page of a run: the run, or the bundle path without suffix."""
    return path.with_suffix("") if is_bundle(path) else path


def bundle(run_dir: os.PathLike[str] | str, file: os.PathLike[str] | str | None = None, *, force: bool = False) -> Path:
    """Pack a run into one file atomically, and return the file.

    The file contains the plan, the machines, the cases, the impulses of each case at its smallest tolerance, and the
    problems that the package does not contain. Identical runs give identical files.

    Args:
        run_dir: the run, or its folder.
        file: the file to write. By default, it is in the current folder and has the name of the run with ``.bundle``.
        force: whether to replace an existing file.

    Raises:
        BenchError: if the folder is not a run, has a damaged file or no measured case, is a study or lacks impulses,
            or if the file exists or cannot be written.
    """
    packed, folder = bundle_of_run(Path(run_dir)), Path(run_dir).resolve()
    path = Path(f"{folder.name}{BUNDLE_SUFFIX}") if file is None else Path(file)
    if path.exists() and not force:
        raise BenchError(f"{path} exists already; name another file, or replace it with `force=True`.")
    write_bundle(packed, path)
    return path


def bundle_of_run(folder: Path) -> Bundle:
    """Return the content of a stored run.

    Raises:
        BenchError: if the folder is not a run, a file of it is damaged, or it cannot be packed.
    """
    store = Store.open(folder)
    run = store.read_run()
    cases, damaged = store.read_cases()
    if damaged:
        raise BenchError(f"{folder} cannot be packed: {damaged[0]}")
    carried = {name: store.read_problem(digest).renamed(name) for name, digest in run.carried.items()}
    return _require_consistent(Bundle(folder, run, cases, carried))


def write_bundle(bundle: Bundle, path: Path) -> None:
    """Write a bundle to a file atomically.

    Raises:
        BenchError: if the bundle is too large to be read again, or the file cannot be written.
    """
    problems = {problem.digest: packed_problem(problem) for problem in bundle.carried.values()}
    content = encode_record(_Content(run=bundle.run, cases=bundle.cases, problems=list(problems.values())))
    if len(content) > MAX_BYTES:
        size = f"{len(content) / 2**20:.0f} MiB"
        raise BenchError(f"{bundle.source} is too large for a bundle ({size}); measure fewer problems per run.")
    put_file(path, gzip.compress(content, mtime=0), "name another file")


def read_bundle(path: Path) -> Bundle:
    """Read a bundle from any source. None of its content is executed, and nothing is written.

    Raises:
        BenchError: if the file is missing, not a bundle, damaged, of another version, or inconsistent.
    """
    if not path.is_file():
        fault = f"{path} is a folder, not a bundle" if path.is_dir() else f"there is no bundle {path}"
        raise BenchError(f"{fault}; name a file that `proxbench bundle` wrote.")
    try:
        packed = path.read_bytes()
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror}; name a readable file.") from None
    if not packed.startswith(_GZIP):
        raise BenchError(f"{path} is not a bundle; name a file that `proxbench bundle` wrote.")
    try:
        text = decompress(packed, MAX_BYTES)
    except ValueError as error:
        raise BenchError(f"{path} is damaged ({error}); {_REMEDY}.") from None
    content = decode_record(text, _Content, str(path), _REMEDY)
    stored = (read_problem(io.BytesIO(packed_file), f"a problem of {path}") for packed_file in content.problems)
    problems, digests = {problem.digest: problem for problem in stored}, content.run.carried
    if problems.keys() != set(digests.values()):
        raise BenchError(f"{path} is damaged (its problems differ from its list of problems); {_REMEDY}.")
    carried = {name: problems[digest].renamed(name) for name, digest in digests.items()}
    return _require_consistent(Bundle(path, content.run, content.cases, carried))


def _require_consistent(bundle: Bundle) -> Bundle:
    """Return a bundle after checking that its parts are consistent.

    Raises:
        BenchError: if they are inconsistent, nothing is measured, or the run is a study or from another version of the
            judge.
    """
    run, source, plan = bundle.run, bundle.source, bundle.run.plan
    if plan.trajectories:
        raise BenchError(f"{source} is a study, whose errors do not follow from impulses; send its folder.")
    if run.judge != JUDGE:
        raise BenchError(
            f"{source} was judged by version {run.judge} of the judge, but this is {JUDGE}; measure it again."
        )
    if not bundle.cases:
        raise BenchError(f"{source} has no measured case; measure at least one case first.")
    planned = {(problem, solver) for problem in plan.problems for solver in plan.solvers}
    for case in bundle.cases:
        fault = _fault(case, run) if (case.problem, case.solver) in planned else "is not in its plan, or occurs twice"
        if fault:
            raise BenchError(f"{source} is inconsistent: {case.solver} on {case.problem} {fault}; measure it again.")
        planned.remove((case.problem, case.solver))
    return bundle


def _fault(case: CaseRecord, run: RunRecord) -> str:
    """Return the inconsistency in a case; empty if there is none."""
    ladder = run.plan.tolerances[: len(case.points)]
    measured = [point.measured for point in case.points if point.measured is not None]
    if [point.tolerance for point in case.points] != ladder:
        return "differs from its plan in its tolerances"
    if any(timed.session >= len(run.sessions) for point in case.points for timed in point.rounds):
        return "refers to a session that its run lacks"
    return "has no impulses" if measured and not measured[-1].impulses else ""
