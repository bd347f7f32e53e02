"""The folder of a run. Each file is written as a whole or not at all.

RUN/run.json            plan, machine, and sessions with their load
RUN/cases/*.json        one case each, with a checksum
RUN/problems/*.npz      the problems that the package does not contain, by their digests
"""

import fcntl
import hashlib
import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from shlex import quote

from ...problems.contact.problem import ContactProblem
from ...problems.exchange.files.atomic_file import PART, replacing
from ...problems.exchange.files.problem_file import SUFFIX, packed_problem, read_problem
from ..errors import BenchError
from .conversion import R, decode_record, encode_record, printable
from .records import CaseRecord, RunRecord

RUN_FILE, CASES, PROBLEMS = "run.json", "cases", "problems"
"""Names in the folder of a run."""

BUNDLE_SUFFIX = ".bundle"
"""Suffix of a run packed into one file."""

ELSEWHERE = "choose another folder with `results`"
"""Remedy if a run cannot be written."""

INVALID_NAME = (
    "is not a valid name of a run; use at most 60 of the characters a-z, A-Z, 0-9, '.', '_' and '-', and begin and end "
    "with a letter, digit or '-'."
)
"""Fault of a name that ``plain_name`` changes."""

MAX_FILE_BYTES = 2**28
"""Largest size of a file of a run [bytes]."""


@dataclass(frozen=True)
class Store:
    """The folder of one run.

    Attributes:
        folder: path of the folder.
    """

    folder: Path
    _written: dict[Path, bytes] = field(default_factory=dict, compare=False, repr=False)

    @staticmethod
    def create(folder: Path) -> "Store":
        """Create the folder of a new run, or reuse one in which no run has begun.

        Raises:
            BenchError: if it contains a run already, or cannot be written.
        """
        store = Store(folder)
        try:
            store._cases.mkdir(parents=True, exist_ok=True)
            store.require_new()
        except OSError as error:
            raise BenchError(f"cannot write {folder}: {error.strerror}; {ELSEWHERE}.") from None
        return store

    @staticmethod
    def open(folder: Path) -> "Store":
        """Open the folder of a stored run.

        Raises:
            BenchError: if the folder is not a run.
        """
        if not (folder / RUN_FILE).is_file():
            raise BenchError(_missing_run_text(folder))
        return Store(folder)

    def require_new(self) -> None:
        """Raise ``BenchError`` if the folder contains more than the two subfolders and temporary files."""
        subfolders = (self._cases, self._problems)
        if any(entry not in subfolders and entry.suffix != PART for entry in self.folder.iterdir()):
            raise BenchError(f"{self.folder} exists already; continue it with `resume`, or choose another `run_id`.")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the run against other writers, and remove the temporary files of a writer that was killed.

        The operating system releases the lock when the process ends.

        Raises:
            BenchError: if another process is writing to the run, or a link leads out of its folder.
        """
        for path in (self._cases, self._problems):
            check_links_inside(path, self.folder)
        try:
            descriptor = os.open(self._cases, os.O_RDONLY)
        except OSError as error:
            raise BenchError(f"cannot read {self._cases}: {error.strerror}; the run is damaged.") from None
        try:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BenchError(f"another process is writing to {self.folder}; wait until it has ended.") from None
            except OSError:
                pass  # a file system without locks
            for path in (self.folder, self._cases, self._problems):
                for temporary_file in path.glob(f".*{PART}"):
                    with suppress(OSError):
                        temporary_file.unlink()
            yield
        finally:
            os.close(descriptor)

    @property
    def _cases(self) -> Path:
        return self.folder / CASES

    @property
    def _problems(self) -> Path:
        return self.folder / PROBLEMS

    def write_run(self, run: RunRecord) -> None:
        """Write run.json.

        Raises:
            BenchError: if it cannot be written.
        """
        self._write(self.folder / RUN_FILE, encode_record(run))

    def read_run(self) -> RunRecord:
        """Return the content of run.json.

        Raises:
            BenchError: if it is damaged.
        """
        return _read(self.folder / RUN_FILE, RunRecord, "begin a new run")

    def write_case(self, case: CaseRecord) -> None:
        """Write one case, finished or not.

        Raises:
            BenchError: if it cannot be written.
        """
        self._write(self._case_file(case), encode_record(case))

    def write_problem(self, problem: ContactProblem) -> None:
        """Write a problem, once for each digest.

        Raises:
            BenchError: if it cannot be written.
        """
        path = self._problem_file(problem.digest)
        if path not in self._written:
            self._write(path, packed_problem(problem))

    def read_problem(self, digest: str) -> ContactProblem:
        """Return a problem of the run by its digest, from memory if this process wrote it, else from its file.

        Raises:
            ProblemError: if its file is missing or damaged.
            BenchError: if its file contains another problem.
        """
        path = self._problem_file(digest)
        known = self._written.get(path)
        problem = read_problem(path if known is None else io.BytesIO(known), str(path))
        if problem.digest != digest:
            raise BenchError(f"{path} contains a problem with another digest; begin a new run.")
        return problem

    def restore(self) -> None:
        """Rewrite files that were deleted or changed after this process wrote them, for example by a plugin.

        Raises:
            BenchError: if a file cannot be written.
        """
        for path, content in self._written.items():
            with suppress(OSError):
                has_same_size = path.is_file() and path.stat().st_size == len(content)
                if has_same_size and path.read_bytes() == content:
                    continue
            put_file(path, content)

    def _write(self, path: Path, content: bytes) -> None:
        self._written[path] = content
        put_file(path, content)

    def _case_file(self, case: CaseRecord) -> Path:
        return self._cases / case_file_name(case)

    def _problem_file(self, digest: str) -> Path:
        return self._problems / f"{digest}{SUFFIX}"

    def read_cases(self, problem: str | None = None) -> tuple[list[CaseRecord], list[str]]:
        """Return all readable cases, or those of one problem, and one message for each damaged file."""
        cases, damaged = [], []
        for file in sorted(self._cases.glob("*.json" if problem is None else f"{plain_name(problem)}--*.json")):
            try:
                case = _read(file, CaseRecord, "resume the run to measure this case again")
                if self._case_file(case) != file:
                    raise BenchError(f"{file.name} contains another case; resume the run to measure its case again.")
                cases.append(case)
            except BenchError as error:
                damaged.append(str(error))
        return cases, damaged


def is_bundle(path: Path) -> bool:
    """Return whether a path is the file of a bundle."""
    return path.suffix == BUNDLE_SUFFIX and path.is_file()


def _missing_run_text(path: Path) -> str:
    """Return why a path is not a stored run, and the remedy."""
    fault, remedy = f"it has no {RUN_FILE}", "name the folder of a run"
    if is_bundle(path):
        fault, remedy = "it is a bundle", f"unpack it with: proxbench merge {quote(str(path))}"
    elif not path.exists():
        fault = "it does not exist"
    elif runs := sorted(file.parent for file in path.glob(f"*/{RUN_FILE}")):
        fault, remedy = f"stored runs in it: {len(runs)}", f"name one of them, such as {runs[-1]}"
    return f"{path} is not a stored run ({fault}); {remedy}."


def case_file_name(case: CaseRecord) -> str:
    """Return the name of the file of a case, which is readable, unique and safe on every system."""
    problem, solver = (plain_name(printable(name)) for name in (case.problem, case.solver))
    return f"{problem}--{solver}.json"


def plain_name(name: str) -> str:
    """Return a name that is safe as a file name on every system; different names stay different."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")
    if plain == name and len(plain) <= 60:
        return plain
    return f"{plain[:51]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def put_file(
    path: Path,
    content: bytes,
    remedy: str = f"free some space, or {ELSEWHERE}",
    kind: type[BenchError] = BenchError,
) -> None:
    """Write a file as a whole or not at all, and create its folder if necessary.

    Raises:
        BenchError: of the class ``kind``, if it cannot be written; the message ends with the remedy.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(content)
    except OSError as error:
        raise kind(f"cannot write {path}: {error.strerror}; {remedy}.") from None


def _read(path: Path, kind: type[R], remedy: str) -> R:
    """Return the record of a file.

    Raises:
        BenchError: if it is damaged, too large, or of another format; the message ends with the remedy.
    """
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE_BYTES:
            raise BenchError(f"{path.name} is too large, or not a regular file; remove it.")
        text = path.read_bytes()
    except OSError as error:
        raise BenchError(f"{path.name} cannot be read: {error.strerror}; change its permissions.") from None
    return decode_record(text, kind, path.name, remedy)


def check_links_inside(place: Path, folder: Path) -> None:
    """Check that no symbolic link leads out of a folder, on the path to a place in it or below that place.

    A stored run may come from an untrusted source, whose links must not redirect what a report writes.

    Raises:
        BenchError: if a link leads out of the folder.
    """
    inside = os.path.realpath(folder)
    above = list(accumulate(place.relative_to(folder).parts, Path.joinpath, initial=folder))[1:]
    below = [Path(top, name) for top, folders, files in os.walk(place) for name in (*folders, *files)]
    for link in (*above, *below):
        target = os.path.realpath(link)
        if os.path.islink(link) and not Path(target).is_relative_to(inside):
            raise BenchError(
                f"{link} is a symbolic link to {target}, outside {folder}; remove it, or name another file or folder."
            )
