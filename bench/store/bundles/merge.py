"""Runs of several machines as one: each problem from one machine, so that what is ranked has met the same.

Cases are told apart by problem and solver. One that is in several sources counts once; where it differs between them,
the finished one counts, and two finished ones are a contradiction.
"""

import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TypeVar
from uuid import uuid4

from msgspec.structs import replace

from ....problems.contact.problem import ContactProblem
from ....problems.exchange.atomic_file import PART
from ...errors import BenchError
from ..plans import PlanRecord
from ..records import CaseRecord, Session, with_sessions
from ..store import ELSEWHERE, Store
from .bundle import Bundle, bundle_of_run, read_bundle
from .rejudge import OnCase, rejudge_bundle

Item = TypeVar("Item")


def merge(
    sources: Sequence[Path],
    folder: Path,
    on_case: OnCase = lambda done, total: None,
    on_missing: Callable[[str], None] = lambda sentence: None,
) -> None:
    """Write the runs of bundles and folders as one run into a new folder, as a whole or not at all.

    Every source is judged again before it counts.

    Args:
        sources: files of bundles, and folders of runs.
        folder: of the new run, named as it is.
        on_case: called with the number of cases of a source that are judged, and of all of it.
        on_missing: called with a sentence for each shard that is missing.

    Raises:
        BenchError: if a source cannot be read or does not agree with what is judged again, sources contradict each
            other or measured on different terms, a problem would have cases of several machines, or the folder exists
            or cannot be written.
    """
    if not sources:
        raise BenchError("nothing to merge; name files of bundles, or folders of runs.")
    if folder.exists():
        raise BenchError(f"{folder} exists already; choose another `run_id`.")
    bundles = [bundle_of_run(source) if source.is_dir() else read_bundle(source) for source in sources]
    for bundle in bundles:
        disagreements = rejudge_bundle(bundle, on_case).disagreements
        if disagreements:
            more = f" (and {len(disagreements) - 1} more cases)" if len(disagreements) > 1 else ""
            raise BenchError(f"{bundle.source} is refused: {disagreements[0].removesuffix('.')}{more}.")
    merged = _Merged(bundles)
    _write(folder, merged)
    for sentence in merged.missing:
        on_missing(sentence)


@dataclass
class _Merged:
    """What several bundles are together.

    Attributes:
        bundles: these.
        run: their plan and sessions.
        cases: by problem and solver.
        carried: the problems that the package does not hold, by name.
        missing: a sentence for each shard that is missing.
    """

    bundles: Sequence[Bundle]
    cases: dict[tuple[str, str], CaseRecord] = field(default_factory=dict)
    carried: dict[str, ContactProblem] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        _refuse_other_terms(self.bundles)
        sessions: list[Session] = []
        sources: dict[tuple[str, str], Path] = {}
        digests: dict[str, str] = {}
        for bundle in self.bundles:
            own = [replace(one, machine=one.machine or bundle.run.machine) for one in bundle.run.sessions]
            sessions += [one for one in own if one not in sessions]
            places = [sessions.index(one) for one in own]
            for case in bundle.cases:
                if digests.setdefault(case.problem, case.digest) != case.digest:
                    raise BenchError(
                        f"the problem {case.problem!r} of {bundle.source} has other numbers elsewhere; rename it."
                    )
                self._add(with_sessions(case, places), bundle, sources)
            self.carried |= bundle.carried
        plan, self.missing = _plan([bundle.run.plan for bundle in self.bundles])
        self.run = replace(
            self.bundles[0].run,
            plan=plan,
            plugins=_once(use for bundle in self.bundles for use in bundle.run.plugins),
            carried={name: problem.digest for name, problem in self.carried.items()},
            sessions=sessions,
        )
        _refuse_several_machines(self.cases.values(), sessions)

    def _add(self, case: CaseRecord, bundle: Bundle, sources: dict[tuple[str, str], Path]) -> None:
        """Add a case, or see that it is there already."""
        key = case.problem, case.solver
        before = self.cases.get(key)
        finished = [one is not None and one.is_finished(bundle.run.plan) for one in (before, case)]
        if all(finished) and before != case:
            raise BenchError(
                f"{case.solver} on {case.problem} is in {sources[key]} and in {bundle.source}, measured twice; leave "
                "one of them out."
            )
        if before is None or finished == [False, True]:
            self.cases[key], sources[key] = case, bundle.source


def _refuse_other_terms(bundles: Sequence[Bundle]) -> None:
    """Raise ``BenchError`` if a bundle was measured on other terms than the first."""
    first = bundles[0]
    for bundle in bundles[1:]:
        for name, word in (("tolerances", "tolerances"), ("limits", "limits"), ("passes", "number of passes")):
            if getattr(bundle.run.plan, name) != getattr(first.run.plan, name):
                raise BenchError(f"{bundle.source} has other {word} than {first.source}; merge runs of the same terms.")


def _refuse_several_machines(cases: Iterable[CaseRecord], sessions: Sequence[Session]) -> None:
    """Raise ``BenchError`` if solvers of one problem were measured on different machines."""
    found: dict[str, str] = {}
    for case in cases:
        for index in sorted({one.session for point in case.points for one in point.rounds}):
            host = sessions[index].host
            if found.setdefault(case.problem, host) != host:
                raise BenchError(
                    f"the solvers of {case.problem} were measured on different machines, {found[case.problem]} and "
                    f"{host}, whose times do not compare; merge runs that have different problems."
                )


def _plan(plans: Sequence[PlanRecord]) -> tuple[PlanRecord, list[str]]:
    """Return what was planned together, and what shards of it are missing.

    Problems of shards take turns, as they did before the run was divided.
    """
    parts = sorted((plan for plan in plans if plan.shard), key=lambda plan: int(plan.shard.partition("/")[0]))
    counts = {plan.shard.partition("/")[2] for plan in plans}
    is_divided = len(parts) == len(plans) and len(counts) == 1
    names = [plan.problems for plan in (parts if is_divided else plans)]
    turns = zip_longest(*names) if is_divided else names
    missing = []
    if is_divided:
        wanted = [f"{number}/{plans[0].shard.partition('/')[2]}" for number in range(1, int(*counts) + 1)]
        missing = [f"shard {one} is missing." for one in wanted if one not in {plan.shard for plan in parts}]
    whole = replace(
        plans[0],
        problems=_once(name for turn in turns for name in turn if name is not None),
        solvers=_once(name for plan in plans for name in plan.solvers),
        families={name: family for plan in plans for name, family in plan.families.items()},
        suite=plans[0].suite if len({plan.suite for plan in plans}) == 1 else "",
        left_out=_once(sentence for plan in plans for sentence in plan.left_out),
        shard="",
    )
    return whole, missing


def _once(items: Iterable[Item]) -> list[Item]:
    found: list[Item] = []
    for item in items:
        if item not in found:
            found.append(item)
    return found


def _write(folder: Path, merged: _Merged) -> None:
    """Write a run beside its place, then put it there."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        made = folder.parent / f".{uuid4()}{PART}"
        made.mkdir()
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; {ELSEWHERE}.") from None
    try:
        store = Store.create(made)
        for problem in merged.carried.values():
            store.write_problem(problem)
        for case in merged.cases.values():
            store.write_case(case)
        store.write_run(replace(merged.run, run_id=folder.name))
        os.rename(made, folder)
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; {ELSEWHERE}.") from None
    finally:
        shutil.rmtree(made, ignore_errors=True)
