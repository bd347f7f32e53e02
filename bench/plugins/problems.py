"""Find the problems of a run, and store those that the package does not contain.

The hard cases and the frozen library have the same numbers in every installation of one version. All other problems
(from plugins, from the caller, or generated) are stored with the run, so that it can be resumed, judged again and shown
without their source.
"""

from collections.abc import Iterable
from pathlib import Path

from ...problems.contact.problem import ContactProblem
from ...problems.errors import ProblemError, suggestion
from ...problems.exchange.catalog import SUITES, is_available, is_shipped, load, plugin_problems, problem_names
from ...problems.exchange.sequences import Predecessors, predecessors
from ..errors import BenchError
from ..store.bundles.bundle import Bundle
from ..store.records import RunRecord
from ..store.store import Store
from .descriptions import plugin_problem


def resolve_problem(problem: str | Path | ContactProblem) -> ContactProblem:
    """Return a problem, given as an object, a name or a file; problems of plugins are created in a child process.

    Raises:
        ProblemError: as in ``load``.
        PluginError: if a plugin does not create the problem.
    """
    if isinstance(problem, ContactProblem):
        return problem
    is_offered = isinstance(problem, str) and problem in {offer.name for offer in plugin_problems()}
    return plugin_problem(str(problem)) if is_offered else load(problem)


def check_known(names: Iterable[str]) -> None:
    """Raise ``ProblemError`` if a name is unknown; see ``load``."""
    known = problem_names()
    for name in names:
        if name not in known:
            load(name)  # raises the error


def check_numbers(problem: ContactProblem) -> None:
    """Raise ``BenchError`` if a problem has the name of a built-in problem, but other numbers."""
    if is_shipped(problem.name) and load(problem.name).digest != problem.digest:
        raise BenchError(
            f"the problem {problem.name!r} differs from the problem of that name in the library; rename it "
            "with problem.renamed(NAME)."
        )


def store_problems(problems: Iterable[str | ContactProblem], store: Store) -> dict[str, str]:
    """Store the available problems that the package does not contain, and return their digests by name.

    Raises:
        BenchError: if a problem cannot be written.
        ProblemError: if a problem cannot be read.
    """
    carried = {}
    for problem in problems:
        name = problem if isinstance(problem, str) else problem.name
        if not is_shipped(name) and (not isinstance(problem, str) or is_available(problem)):
            resolved = resolve_problem(problem)
            store.write_problem(resolved)
            carried[name] = resolved.digest
    return carried


def problem_of_run(store: Store | Bundle, run: RunRecord, name: str) -> ContactProblem:
    """Return a problem of a run, from the run or from the package.

    Raises:
        ProblemError: if the run has no problem of that name, or its file is missing or damaged.
        BenchError: if its file contains another problem.
    """
    if name not in run.plan.problems:
        raise ProblemError(f"the run has no problem {name!r}{suggestion(name, run.plan.problems)}")
    problem = store.read_problem(run.carried[name]) if name in run.carried else resolve_problem(name)
    return problem if problem.name == name else problem.renamed(name)


def predecessors_of_run(store: Store | Bundle, run: RunRecord, problem: ContactProblem) -> Predecessors:
    """Return the steps before a problem of a run in its sequence, from the run or from the package.

    Raises:
        ProblemError: if the file of a step is missing or damaged.
        BenchError: if the file of a step contains another problem.
    """

    def find(name: str) -> ContactProblem | None:
        if name in run.carried:
            return store.read_problem(run.carried[name])
        return load(name) if name in SUITES["all"] and is_available(name) else None

    return predecessors(problem, find)
