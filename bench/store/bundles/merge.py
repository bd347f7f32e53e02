"""Merge several runs into one, each problem measured on one machine.

A case that several sources contain counts once. A finished case replaces an unfinished one; two finished cases that
differ are an error.
"""

import os
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from msgspec.structs import replace

from ....problems.exchange.files.atomic_file import PART
from ...errors import BenchError
from ..plans import PlanRecord
from ..records import CaseRecord, RunRecord, Session, with_sessions
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

    Args:
        sources: files of bundles, and folders of runs. Their residuals are recomputed first.
        folder: folder of the new run; its name becomes that of the run.
        on_case: called with the number of recomputed cases of a source and of all its cases.
        on_missing: called with a sentence for each missing shard.

    Raises:
        BenchError: if a source cannot be read or its residuals disagree, sources contradict each other or have
            different settings, a problem was measured on several machines, or the folder exists or cannot be written.
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
            raise BenchError(f"{bundle.source} is rejected: {disagreements[0].removesuffix('.')}{more}.")
    _require_same_settings(bundles)
    plans = [bundle.run.plan for bundle in bundles]
    _write(folder, _merged(bundles, folder, _merged_plan(plans)))
    for shard in _missing_shards(plans):
        on_missing(f"shard {shard} is missing.")


def _merged(bundles: Sequence[Bundle], folder: Path, plan: PlanRecord) -> Bundle:
    """Return the run of several bundles.

    Raises:
        BenchError: if they contradict each other, or a problem was measured on several machines.
    """
    sessions: list[Session] = []
    cases: dict[tuple[str, str], tuple[CaseRecord, Bundle]] = {}
    digests: dict[str, str] = {}
    starts: dict[str, str] = {}
    for bundle in bundles:
        sessions += [session for session in bundle.run.sessions if session not in sessions]
        session_indices = [sessions.index(session) for session in bundle.run.sessions]
        for case in bundle.cases:
            if digests.setdefault(case.problem, case.digest) != case.digest:
                raise BenchError(
                    f"the problem {case.problem!r} of {bundle.source} differs from that of another source; rename it."
                )
            if case.start and starts.setdefault(case.problem, case.start) != case.start:
                raise BenchError(
                    f"the warm solvers on {case.problem!r} of {bundle.source} start from other steps or contacts than "
                    "in another source; leave one of them out."
                )
            candidate, key = (with_sessions(case, session_indices), bundle), (case.problem, case.solver)
            cases[key] = _choose_record(cases[key], candidate) if key in cases else candidate
    merged = [case for case, _ in cases.values()]
    _require_one_machine(merged, sessions)
    carried = {name: problem for bundle in bundles for name, problem in bundle.carried.items()}
    run: RunRecord = replace(
        bundles[0].run,
        run_id=folder.name,
        plan=plan,
        plugins=_unique(use for bundle in bundles for use in bundle.run.plugins),
        carried={name: problem.digest for name, problem in carried.items()},
        sessions=sessions,
    )
    return Bundle(folder, run, merged, carried)


def _choose_record(first: tuple[CaseRecord, Bundle], second: tuple[CaseRecord, Bundle]) -> tuple[CaseRecord, Bundle]:
    """Return one of two records of a case, with its source: the finished one, or the first.

    Raises:
        BenchError: if both are finished, but differ.
    """
    is_finished = [case.is_finished(bundle.run.plan) for case, bundle in (first, second)]
    (case, source), (other, other_source) = first, second
    if all(is_finished) and case != other:
        raise BenchError(
            f"{case.solver} on {case.problem} was measured in {source.source} and again in {other_source.source}; "
            "leave one of them out."
        )
    return second if is_finished == [False, True] else first


def _require_same_settings(bundles: Sequence[Bundle]) -> None:
    """Raise ``BenchError`` if a bundle was measured with other settings than the first."""
    reference = bundles[0]
    for bundle in bundles[1:]:
        for name, label in (("tolerances", "tolerances"), ("limits", "limits"), ("passes", "number of passes")):
            if getattr(bundle.run.plan, name) != getattr(reference.run.plan, name):
                raise BenchError(
                    f"{bundle.source} has other {label} than {reference.source}; merge runs with the same settings."
                )


def _require_one_machine(cases: Iterable[CaseRecord], sessions: Sequence[Session]) -> None:
    """Raise ``BenchError`` if solvers of one problem were measured on different machines."""
    hosts: dict[str, str] = {}
    for case in cases:
        for index in sorted({timed.session for point in case.points for timed in point.rounds}):
            host = sessions[index].machine.host
            if hosts.setdefault(case.problem, host) != host:
                raise BenchError(
                    f"the solvers of {case.problem} were measured on different machines, {hosts[case.problem]} and "
                    f"{host}, whose times are not comparable; merge runs of different problems."
                )


def _shards(plan: PlanRecord) -> tuple[list[int], int]:
    """Return the numbers of the shards that a run has, and the number of all shards; none for an undivided run."""
    if plan.shard:
        number, count = _numbers(plan.shard)
        return [number], count
    missing = list(map(_numbers, plan.missing_shards))
    count = missing[0][1] if missing else 0
    return [number for number in range(1, count + 1) if (number, count) not in missing], count


def _numbers(shard: str) -> tuple[int, int]:
    """Return i and n of a shard ``"i/n"``."""
    number, _, count = shard.partition("/")
    return int(number), int(count)


def _are_shards(plans: Sequence[PlanRecord]) -> bool:
    """Return whether all plans are shards of one run, or were merged from such shards."""
    counts = {_shards(plan)[1] for plan in plans}
    return len(counts) == 1 and 0 not in counts and _select_the_same(plans)


def _missing_shards(plans: Sequence[PlanRecord]) -> list[str]:
    """Return the missing shards of a divided run."""
    if not _are_shards(plans):
        return []
    count, present = _shards(plans[0])[1], {number for plan in plans for number in _shards(plan)[0]}
    return [f"{number}/{count}" for number in range(1, count + 1) if number not in present]


def _merged_plan(plans: Sequence[PlanRecord]) -> PlanRecord:
    """Return the plan of all runs; problems of shards alternate, as before the run was divided."""
    is_undivided = not any(_shards(plan)[1] for plan in plans)
    has_one_selection = _are_shards(plans) or (is_undivided and _select_the_same(plans))
    return replace(
        plans[0],
        problems=_unique(_problems_in_order(plans)),
        solvers=_unique(name for plan in plans for name in plan.solvers),
        families={name: family for plan in plans for name, family in plan.families.items()},
        suite=plans[0].suite if len({plan.suite for plan in plans}) == 1 else "",
        requested=plans[0].requested if has_one_selection else [],
        left_out=_unique(sentence for plan in plans for sentence in plan.left_out),
        available=_available(plans),
        shard="",
        missing_shards=_missing_shards(plans),
    )


def _problems_in_order(plans: Sequence[PlanRecord]) -> list[str]:
    """Return the problems of all plans, those of shards in the order of the undivided run."""
    if not _are_shards(plans):
        return [name for plan in plans for name in plan.problems]
    places: dict[str, int] = {}
    for plan in plans:
        numbers, count = _shards(plan)
        for index, name in enumerate(plan.problems):
            turn, position = divmod(index, len(numbers))
            places[name] = turn * count + numbers[position]
    return sorted(places, key=places.__getitem__)


def _available(plans: Sequence[PlanRecord]) -> int | None:
    """Return the number of problems of which a merged run has all or a part; None if unknown.

    Runs of one suite, or of the same given problems, have parts of the same problems.
    """
    totals = {plan.available for plan in plans}
    selections = {(plan.suite, *(() if plan.suite else plan.requested)) for plan in plans}
    return plans[0].available if len(totals) == len(selections) == 1 else None


def _select_the_same(plans: Sequence[PlanRecord]) -> bool:
    """Return whether the plans have all or a part of the problems of one selection."""
    names = ("suite", "requested", "sample", "sampling", "seed")
    return all(getattr(plan, name) == getattr(plans[0], name) for plan in plans for name in names)


def _unique(items: Iterable[Item]) -> list[Item]:
    """Return the items in order, each once; they need not be hashable."""
    unique_items: list[Item] = []
    for item in items:
        if item not in unique_items:
            unique_items.append(item)
    return unique_items


def _write(folder: Path, merged: Bundle) -> None:
    """Write a run into a temporary folder, and rename it to ``folder``."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".", suffix=PART) as temporary_folder:
            store = Store.create(Path(temporary_folder, "run"))
            for problem in merged.carried.values():
                store.write_problem(problem)
            for case in merged.cases:
                store.write_case(case)
            store.write_run(merged.run)
            os.rename(store.folder, folder)
    except OSError as error:
        raise BenchError(f"cannot write {folder}: {error.strerror}; {ELSEWHERE}.") from None
