"""Results on disk: one folder a run, one JSON file a case, each written as a whole or not at all.

RUN/run.json            what was planned, the machine, its drift and load in each session
RUN/cases/*.json        one finished case each, with a checksum of its content
RUN/problems/*.npz      the problems that the package itself does not hold, by their digests
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

from ...problems.contact.problem import ContactProblem
from ...problems.exchange.atomic_file import PART, replacing
from ...problems.exchange.storage import SUFFIX, packed_problem, read_problem
from ..errors import BenchError
from .conversion import R, content_of, sealed, unsealed
from .records import CaseRecord, RunRecord

RUN_FILE, CASES, PROBLEMS = "run.json", "cases", "problems"
"""Names in the folder of a run."""

ELSEWHERE = "choose another folder with `results`"
"""What to do where a run cannot be written."""

UNFIT_NAME = (
    "is no name of a run; use at most 60 of the characters a-z, A-Z, 0-9, '.', '_' and '-', and begin and end with a "
    "letter, digit or '-'."
)
"""What is wrong with a name that ``plain_name`` changes."""

MAX_FILE_BYTES = 2**28
"""Bytes that a file of a run may have."""


@dataclass(frozen=True)
class Store:
    """The folder of one run."""

    folder: Path
    _written: dict[Path, bytes] = field(default_factory=dict, compare=False, repr=False)

    @staticmethod
    def create(folder: Path) -> "Store":
        """Make the folder of a new run; one in which a run was killed before it began is taken.

        Raises:
            BenchError: if there is a run in it already, or it cannot be written.
        """
        store = Store(folder)
        try:
            store._cases.mkdir(parents=True, exist_ok=True)
            store.refuse_second()
        except OSError as error:
            raise BenchError(f"cannot write {folder}: {error.strerror}; {ELSEWHERE}.") from None
        return store

    @staticmethod
    def open(folder: Path) -> "Store":
        """Open the folder of a stored run.

        Raises:
            BenchError: if it is none.
        """
        if not (folder / RUN_FILE).is_file():
            raise BenchError(_no_run(folder))
        return Store(folder)

    def refuse_second(self) -> None:
        """Raise ``BenchError`` if the folder holds more than the folders of a run that has not begun."""
        own = (self._cases, self._problems)
        if any(entry not in own and entry.suffix != PART for entry in self.folder.iterdir()):
            raise BenchError(f"{self.folder} exists already; continue it with `resume`, or choose another `run_id`.")

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other processes from writing to the run meanwhile, and remove what a killed one had half written.

        The lock is one of the system's on the folder, which goes with the process however that ends.

        Raises:
            BenchError: if another process is writing to it, or a link leads out of it.
        """
        for place in (self._cases, self._problems):
            refuse_links_out(place, self.folder)
        try:
            folder = os.open(self._cases, os.O_RDONLY)
        except OSError as error:
            raise BenchError(f"cannot read {self._cases}: {error.strerror}; the run is damaged.") from None
        try:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BenchError(f"another process is writing to {self.folder}; wait until it has ended.") from None
            except OSError:
                pass  # a file system without locks
            for place in (self.folder, self._cases, self._problems):
                for part in place.glob(f".*{PART}"):
                    with suppress(OSError):
                        part.unlink()
            yield
        finally:
            os.close(folder)

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
        self._write(self.folder / RUN_FILE, sealed(content_of(run)))

    def read_run(self) -> RunRecord:
        """Return what run.json says.

        Raises:
            BenchError: if it is damaged.
        """
        return _read(self.folder / RUN_FILE, RunRecord, "begin a new run")

    def write_case(self, case: CaseRecord) -> None:
        """Write one finished case, its names and texts as they can be shown anywhere.

        Raises:
            BenchError: if it cannot be written.
        """
        content = content_of(case)
        self._write(self.folder / case_file(content["problem"], content["solver"]), sealed(content))

    def write_problem(self, problem: ContactProblem) -> None:
        """Write a problem, once for each digest.

        Raises:
            BenchError: if it cannot be written.
        """
        path = self.folder / problem_file(problem.digest)
        if path not in self._written:
            self._write(path, packed_problem(problem))

    def read_problem(self, digest: str) -> ContactProblem:
        """Return a problem of the run by its digest, as this process wrote it or else from its file.

        Raises:
            ProblemError: if its file is missing or damaged.
            BenchError: if its file holds another problem.
        """
        path = self.folder / problem_file(digest)
        known = self._written.get(path)
        problem = read_problem(path if known is None else io.BytesIO(known), str(path))
        if problem.digest != digest:
            raise BenchError(f"{path} holds another problem than its name says; begin a new run.")
        return problem

    def restore(self) -> None:
        """Write again what was written before and is gone or another now: a plugin may do what its user may.

        Raises:
            BenchError: if it cannot be written.
        """
        for path, content in self._written.items():
            if not _holds(path, content):
                _put(path, content)

    def _write(self, path: Path, content: bytes) -> None:
        self._written[path] = content
        _put(path, content)

    def read_cases(self, problem: str | None = None) -> tuple[list[CaseRecord], list[str]]:
        """Return all readable cases, and one sentence for each damaged file; stray parts of writes are ignored.

        Those of one problem if its name is given.
        """
        cases, damaged = [], []
        for file in sorted(self._cases.glob("*.json" if problem is None else f"{plain_name(problem)}--*.json")):
            try:
                case = _read(file, CaseRecord, "resume the run to measure it again")
                if self.folder / case_file(case.problem, case.solver) != file:
                    raise BenchError(f"{file.name} holds another case than its name says.")
                cases.append(case)
            except BenchError as error:
                damaged.append(f"{file.name} is left out: {error}")
        return cases, damaged


def case_file(problem: str, solver: str) -> str:
    """Return the file of a case in the folder of a run: readable, safe as a file name, and unique."""
    return f"{CASES}/{plain_name(problem)}--{plain_name(solver)}.json"


def problem_file(digest: str) -> str:
    """Return the file of a problem in the folder of a run."""
    return f"{PROBLEMS}/{digest}{SUFFIX}"


def _no_run(path: Path) -> str:
    """Return why a path is no stored run, and the remedy."""
    if path.suffix == ".bundle" and path.is_file():
        return f"{path} is a bundle, not the folder of a run; unpack it with: proxbench merge {path}"
    if not path.exists():
        return f"{path} is no stored run (there is nothing of that name); name the folder of a run."
    runs = sorted(file.parent for file in path.glob(f"*/{RUN_FILE}")) if path.is_dir() else []
    if runs:
        return f"{path} is no stored run but holds {len(runs)}; name one of them, such as {runs[-1]}."
    return f"{path} is no stored run (it has no {RUN_FILE}); name the folder of a run."


def plain_name(name: str) -> str:
    """Return ``name`` reduced to what is safe in a file name anywhere; different names stay different."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")
    if plain == name and len(plain) <= 60:
        return plain
    return f"{plain[:51]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _put(path: Path, content: bytes) -> None:
    """Write to a temporary file beside ``path``, then put it in place; a folder that is gone is made again."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(content)
    except OSError as error:
        raise BenchError(f"cannot write {path}: {error.strerror}; make room, or {ELSEWHERE}.") from None


def _holds(path: Path, content: bytes) -> bool:
    try:
        return path.is_file() and path.stat().st_size == len(content) and path.read_bytes() == content
    except OSError:
        return False


def _read(path: Path, kind: type[R], remedy: str) -> R:
    """Return the record of a file.

    Raises:
        BenchError: if it is damaged, too large, or of another format; the sentence ends with the remedy.
    """
    try:
        if not path.is_file() or path.stat().st_size > MAX_FILE_BYTES:
            raise BenchError(f"{path.name} is no file that a run writes; remove it.")
        text = path.read_bytes()
    except OSError as error:
        raise BenchError(f"cannot read {path}: {error.strerror}.") from None
    return unsealed(text, kind, path.name, remedy)


def refuse_links_out(place: Path, folder: Path) -> None:
    """Find out whether a link on the way from a folder to a place in it, or below that place, leads out of the folder.

    Results may come from elsewhere: showing them must not replace files wherever their links say.

    Raises:
        BenchError: if one does.
    """
    inside = os.path.realpath(folder)
    way = list(accumulate(place.relative_to(folder).parts, Path.joinpath, initial=folder))[1:]
    below = [Path(top, name) for top, folders, files in os.walk(place) for name in (*folders, *files)]
    for link in (*way, *below):
        target = os.path.realpath(link)
        if os.path.islink(link) and not Path(target).is_relative_to(inside):
            raise BenchError(
                f"{link} is a link out of {folder}, to {target}, and nothing is written through it; "
                "remove it, or name another place."
            )
