"""A run as one file: plan, machines, cases with the impulses of their finest points, and the problems that it carries.

What is read from one may come from a stranger: it is data without code, its names lead nowhere, and what it says holds
together. Whether it is true is what ``rejudge`` finds out.
"""

import io
from dataclasses import dataclass
from pathlib import Path

from ....problems.contact.judge import JUDGE
from ....problems.contact.problem import ContactProblem
from ....problems.errors import ProblemError
from ....problems.exchange.catalog import is_held, load
from ....problems.exchange.storage import packed_problem, read_problem
from ...errors import BenchError
from ..conversion import content_of, sealed, unsealed
from ..records import CaseRecord, RunRecord
from ..store import CASES, PROBLEMS, RUN_FILE, Store, case_file, problem_file
from .archive import read_members, write_members

SUFFIX = ".bundle"
"""How files of bundles end."""


@dataclass(frozen=True)
class Bundle:
    """A run that has travelled, or will.

    Attributes:
        source: its file, or the folder of the run.
        run: plan and machines.
        cases: what is measured.
        carried: the problems that the package does not hold, by name.
    """

    source: Path
    run: RunRecord
    cases: list[CaseRecord]
    carried: dict[str, ContactProblem]

    def problem(self, name: str) -> ContactProblem:
        """Return a problem of the run: that of the package if it holds one of the name, else the carried one.

        Raises:
            BenchError: if there is neither, or both have other numbers.
        """
        carried = self.carried.get(name)
        if not is_held(name):
            if carried is None:
                raise BenchError(f"the problem {name!r} is neither with {self.source} nor in this package.")
            return carried
        held = load(name)
        if carried is not None and carried.digest != held.digest:
            raise BenchError(f"the problem {name!r} of {self.source} has other numbers than that of the library.")
        return held


def bundle_of_run(folder: Path) -> Bundle:
    """Return what a stored run has to send.

    Raises:
        BenchError: if the folder is no run, a file of it is damaged, nothing is measured, or ``checked`` refuses it.
    """
    store = Store.open(folder)
    run = store.read_run()
    cases, damaged = store.read_cases()
    if damaged:
        raise BenchError(
            f"{folder} is not whole: {damaged[0].removesuffix('.')}; finish it with: proxbench run --resume {folder}"
        )
    carried = {name: store.read_problem(digest).renamed(name) for name, digest in run.carried.items()}
    return _checked(Bundle(folder, run, cases, carried))


def write_bundle(bundle: Bundle, path: Path) -> None:
    """Write a bundle to a file, as a whole or not at all.

    Raises:
        BenchError: if it cannot be written.
    """
    members = {RUN_FILE: sealed(content_of(bundle.run))}
    for case in bundle.cases:
        content = content_of(case)
        members[case_file(content["problem"], content["solver"])] = sealed(content)
    members |= {problem_file(problem.digest): packed_problem(problem) for problem in bundle.carried.values()}
    write_members(path, members)


def read_bundle(path: Path) -> Bundle:
    """Read a bundle from anywhere. No code of it runs, and nothing is written.

    Raises:
        BenchError: if it is none, damaged, of another version, or does not hold together.
    """
    members = read_members(path)
    if RUN_FILE not in members:
        raise BenchError(f"{path} is damaged (it has no {RUN_FILE}); get it again from where it comes.")
    remedy = f"get {path} again from where it comes"
    run = unsealed(members[RUN_FILE], RunRecord, RUN_FILE, remedy)
    cases = []
    for name, content in members.items():
        if name.startswith(f"{CASES}/"):
            case = unsealed(content, CaseRecord, name, remedy)
            if case_file(case.problem, case.solver) != name:
                raise BenchError(f"{path} is damaged ({name} is about another case); {remedy}.")
            cases.append(case)
    files = {name for name in members if name.startswith(f"{PROBLEMS}/")}
    if files != {problem_file(digest) for digest in run.carried.values()}:
        raise BenchError(f"{path} is damaged (its problems are not those that it lists); {remedy}.")
    carried = {name: _problem(members[problem_file(digest)], name, digest) for name, digest in run.carried.items()}
    return _checked(Bundle(path, run, cases, carried))


def _problem(content: bytes, name: str, digest: str) -> ContactProblem:
    problem = read_problem(io.BytesIO(content), problem_file(digest))
    if problem.digest != digest:
        raise ProblemError(f"{problem_file(digest)} holds another problem than its name says.")
    return problem.renamed(name)


def _checked(bundle: Bundle) -> Bundle:
    """Return a bundle whose parts fit each other.

    Raises:
        BenchError: if they do not, nothing is measured, it is a study, or another version of the judge has judged it.
    """
    run, source, plan = bundle.run, bundle.source, bundle.run.plan
    if plan.trajectories:
        raise BenchError(f"{source} is a study, whose errors no impulses prove; send its folder.")
    if run.judge != JUDGE:
        raise BenchError(f"{source} was judged by version {run.judge} of the judge, this is {JUDGE}; measure it again.")
    if not bundle.cases:
        raise BenchError(f"{source} has no measured case; measure something first.")
    problems, solvers, seen = set(plan.problems), set(plan.solvers), set[tuple[str, str]]()
    for case in bundle.cases:
        cell = case.problem, case.solver
        is_planned = case.problem in problems and case.solver in solvers and cell not in seen
        fault = _fault(case, run) if is_planned else "is none that its plan has"
        if fault:
            raise BenchError(f"{source} is refused: {case.solver} on {case.problem} {fault}; measure it again.")
        seen.add(cell)
    return bundle


def _fault(case: CaseRecord, run: RunRecord) -> str:
    """Return what of a case cannot be; empty if all can."""
    ladder = run.plan.tolerances[: len(case.points)]
    measured = [point.measured for point in case.points if point.measured is not None]
    if [point.tolerance for point in case.points] != ladder:
        return "has other tolerances than its plan"
    if any(one.session >= len(run.sessions) for point in case.points for one in point.rounds):
        return "has rounds of a session that its run has not"
    if measured and not measured[-1].impulses:
        return "has no impulses, as runs of earlier versions have none"
    return ""
