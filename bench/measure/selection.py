"""Select the problems of a run from names, files, folders, suites and objects, each with its family.

Problems that are named individually must be valid. Invalid files of a folder are skipped, with the reason.
"""

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...problems.contact.problem import ContactProblem
from ...problems.errors import ProblemError, ProxbenchError
from ...problems.exchange.catalog import SUITES, is_path, load, plugin_problems, problem_names, suite_members
from ...problems.exchange.families import Sampling, check_sampling, family_of, sampled
from ...problems.exchange.folder import Member, list_folder
from ..errors import BenchError
from ..plugins.problems import check_known, check_numbers, resolve_problem

ProblemSource = str | Path | ContactProblem
"""A problem, its name or file, or a folder of files."""


@dataclass(frozen=True)
class Selection:
    """The problems of a run.

    Attributes:
        problems: the problems, or their names if they are loaded later.
        families: family of each problem, by name.
        suite: name of the suite; empty if the problems were named.
        left_out: a sentence for each file of a folder that cannot be measured.
        available: number of problems of the suite, or of the given ones, of which ``problems`` may be a part.
    """

    problems: tuple[str | ContactProblem, ...]
    families: dict[str, str]
    suite: str = ""
    left_out: tuple[str, ...] = ()
    available: int = 0


def select(
    problems: Sequence[ProblemSource] | None,
    suite: str | Path,
    sample: int | None = None,
    seed: int = 0,
    sampling: Sampling = "proportional",
) -> Selection:
    """Return the given problems, or the members of a suite, or a sample of them.

    Problems of plugins are built and files are read here; named problems are loaded later.

    Args:
        problems: names, files, folders and problem objects; the members of ``suite`` if None.
        suite: name of a suite, or a folder, see ``list_folder``.
        sample: number of problems of a sample, without files that cannot be read; all problems if None.
        seed: seed of the sample.
        sampling: how the sample is divided among families, see ``sampled``.

    Raises:
        ProblemError: for an unknown problem or suite (the message suggests the nearest name), a file without a problem,
            a folder without readable problems, or a sample that is not positive.
        PluginError: if a plugin does not create its problem.
        BenchError: for an empty list of problems, a name given twice, or a problem with the name of a library problem
            and other numbers.
    """
    if problems is not None and not problems:
        raise BenchError("no problem is given; name at least one, or omit the problems to measure a suite.")
    check_sampling(sample, sampling)
    sources, suite_name = (tuple(problems), "") if problems else _members(suite)
    candidates, left_out, folders = _candidates(sources)
    loaded: dict[str, str | ContactProblem] = {}
    while candidates:
        sample_candidates = candidates if sample is None else _draw_sample(candidates, sample, seed, sampling)
        reasons = _load_into(loaded, sample_candidates)
        if not reasons:
            break
        left_out += reasons.values()
        # other problems are drawn in place of those that cannot be read
        candidates = [candidate for candidate in candidates if candidate.name not in reasons]
    else:
        raise ProblemError(f"none of {len(left_out)} problem files can be measured; the first: {left_out[0]}")
    families = {candidate.name: candidate.family for candidate in sample_candidates}
    if suite_name and folders:
        suite_name = folders[0]
    return Selection(tuple(loaded[name] for name in families), families, suite_name, tuple(left_out), len(candidates))


def select_shard(selection: Selection, shard: str) -> tuple[Selection, str]:
    """Return every n-th problem from the i-th on, for a shard ``"i/n"``, and the shard without leading zeros.

    Raises:
        BenchError: if ``shard`` is invalid, or has no problem.
    """
    number, count = parse_shard(shard)
    problems = selection.problems[number - 1 :: count]
    if not problems:
        raise BenchError(
            f"`shard` {shard} has none of the problems ({len(selection.problems)} in all); use fewer shards."
        )
    names = set(map(problem_name, problems))
    families = {name: family for name, family in selection.families.items() if name in names}
    return replace(selection, problems=problems, families=families), f"{number}/{count}"


def parse_shard(shard: str) -> tuple[int, int]:
    """Return i and n of a shard ``"i/n"``, which may have leading zeros.

    Raises:
        BenchError: if ``shard`` is invalid.
    """
    match = re.fullmatch(r"([0-9]{1,5})/([0-9]{1,5})", shard) if isinstance(shard, str) else None
    number, count = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= count:
        raise BenchError(f"`shard` must be i/n with 1 ≤ i ≤ n, such as 2/8, got {shard!r:.60}.")
    return number, count


def problem_name(problem: ProblemSource) -> str:
    """Return the name of a problem, or its file as given."""
    return problem.name if isinstance(problem, ContactProblem) else str(problem)


@dataclass(frozen=True)
class _Candidate:
    """A candidate problem of the run; ``source`` is its name if it is loaded later."""

    name: str
    family: str
    source: str | ContactProblem | Member


def _candidates(requested: Sequence[ProblemSource]) -> tuple[list[_Candidate], list[str], list[str]]:
    """Return all given problems, the reasons for skipped files, and the names of the folders."""
    for item in requested:
        _require_problem(item)
    known_names = set(problem_names())
    names = [item for item in requested if isinstance(item, str) and not is_path(item)]
    check_known(name for name in names if not _is_folder(name, known_names))
    sources = {offer.name: offer.source for offer in plugin_problems()}
    candidates, left_out, folders = [], list[str](), list[str]()
    for item in requested:
        if _is_folder(item, known_names):
            folder = list_folder(str(item))
            folders.append(folder.name)
            left_out += [reason for _, reason in folder.broken]
            candidates += [_Candidate(member.name, member.family, member) for member in folder.members]
        elif isinstance(item, str) and not is_path(item) and item not in sources:
            candidates.append(_Candidate(item, family_of(item), item))
        else:
            problem = resolve_problem(item)
            check_numbers(problem)
            family = sources.get(problem.name) or family_of(problem)
            candidates.append(_Candidate(problem.name, family, problem))
    require_unique("problem", (candidate.name for candidate in candidates))
    return candidates, left_out, folders


def _require_problem(source: object) -> None:
    """Raise ``ProblemError`` if an object cannot denote a problem."""
    if not isinstance(source, str | Path | ContactProblem):
        raise ProblemError(
            f"`problems` must be names, files or contact problems, not {type(source).__name__}; for a matrix G, pass "
            "ContactProblem.from_delassus(G, c, mu)."
        )


def _draw_sample(candidates: Sequence[_Candidate], sample: int, seed: int, sampling: Sampling) -> list[_Candidate]:
    """Return a sample of the candidates, in their order."""
    names = set(sampled({candidate.name: candidate.family for candidate in candidates}, sample, seed, sampling))
    return [candidate for candidate in candidates if candidate.name in names]


def _load_into(loaded: dict[str, str | ContactProblem], candidates: Sequence[_Candidate]) -> dict[str, str]:
    """Add the problems of candidates to ``loaded``; return the reasons why some cannot be read, by name."""
    reasons = {}
    for candidate in candidates:
        try:
            if candidate.name not in loaded:
                source = candidate.source
                loaded[candidate.name] = _load_member(source) if isinstance(source, Member) else source
        except ProxbenchError as error:
            reasons[candidate.name] = str(error)
    return reasons


def _members(suite: str | Path) -> tuple[tuple[ProblemSource, ...], str]:
    """Return the members of a suite and its name; for a folder, the folder as the only member.

    Raises:
        ProblemError: if there is no such suite or folder.
    """
    given: object = suite
    if not isinstance(given, str | Path):
        raise ProblemError(f"`suite` must be the name of a suite, or a folder, not {type(given).__name__}.")
    if isinstance(suite, str) and (suite in SUITES or not (os.path.isdir(suite) or "/" in suite)):
        return tuple(suite_members(suite)), suite
    if not os.path.isdir(suite):
        raise ProblemError(f"there is no folder {suite}.")
    return (Path(suite),), str(suite)


def _is_folder(source: ProblemSource, known: set[str]) -> bool:
    """Return whether problems are given as a folder; the name of a problem takes precedence."""
    if isinstance(source, ContactProblem) or source in known:
        return False
    return os.path.isdir(source)


def _load_member(member: Member) -> ContactProblem:
    """Return a problem of a folder, named after its file."""
    problem = load(member.path).renamed(member.name)
    try:
        check_numbers(problem)
    except BenchError:
        raise BenchError(
            f"{member.path} differs from the problem {member.name!r} of the library; rename the file."
        ) from None
    return problem


def require_unique(what: str, names: Iterable[str]) -> None:
    """Raise ``BenchError`` if a name of a problem or solver is given twice."""
    name, count = next(iter(Counter(names).most_common(1)), ("", 0))
    if count > 1:
        raise BenchError(f"the {what} {name!r} is given more than once; name it once.")
