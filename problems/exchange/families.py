"""Families of problems, which group them in tables and samples."""

import hashlib
import re
from collections.abc import Mapping
from functools import cache
from typing import Literal, get_args

from ..contact.problem import ContactProblem
from ..errors import ProblemError, suggestion
from ..hard import CASE_GROUPS
from .catalog import BODY_GROUPS, SEQUENCE_MEMBERS

FAMILY = "family"
"""Key of the family in the provenance of a problem."""


Sampling = Literal["proportional", "even"]
"""Division of a sample among families: by their sizes, or equally."""


def family_of(problem: str | ContactProblem) -> str:
    """Return the family of a problem.

    The provenance of a problem may name its family. Otherwise its name determines it: the group of a hard case or of a
    problem of the suite ``bodies`` (``"hard: stacks"``, ``"bodies: arches"``), the sequence of a step, else the part
    before the first dash or the options of a scene (``"funnel"``).
    """
    if not isinstance(problem, str):
        named = problem.provenance.get(FAMILY)
        return str(named) if named else family_of(problem.name)
    return _grouped_families().get(problem) or re.split("[-(]", problem, maxsplit=1)[0] or problem


def sampled(families: Mapping[str, str], count: int, seed: int, sampling: Sampling = "proportional") -> list[str]:
    """Return ``count`` of the problems in their order; all if there are no more.

    "proportional" rounds the share of each family up or down (by largest remainders). "even" takes the same number from
    each family, and all members of smaller ones. The sample consists of the names with the smallest SHA-256 together
    with ``seed``. It is the same on all machines, and changes little when problems are added.

    Args:
        families: the family of each problem, by name.
        count: size of the sample.
        seed: selects one of many samples.
        sampling: "proportional" or "even".

    Raises:
        ProblemError: if ``count`` is not positive, or ``sampling`` is unknown.
    """
    if sampling not in get_args(Sampling):
        raise ProblemError(f"`sampling` {sampling!r} is unknown{suggestion(str(sampling), get_args(Sampling))}")
    if count < 1:
        raise ProblemError(f"a sample must have at least one problem, got {count}.")
    members: dict[str, list[str]] = {}
    for name, family in families.items():
        members.setdefault(family, []).append(name)
    chosen: set[str] = set()
    sizes = {family: len(names) for family, names in members.items()}
    divide = _shares if sampling == "proportional" else _even_shares
    for family, share in divide(sizes, min(count, len(families))).items():
        chosen |= set(sorted(members[family], key=lambda name: _rank(name, seed))[:share])
    return [name for name in families if name in chosen]


@cache
def _grouped_families() -> Mapping[str, str]:
    hard = {name: f"hard: {group}" for group, members in CASE_GROUPS.items() for name in members}
    bodies = {f"bodies-{name}": f"bodies: {group}" for group, members in BODY_GROUPS.items() for name in members}
    steps = {step: f"sequence: {name}" for name, members in SEQUENCE_MEMBERS.items() for step in members}
    return hard | bodies | steps


def _shares(sizes: Mapping[str, int], count: int) -> dict[str, int]:
    """Return the share of each family in ``count``, by largest remainders; ties follow the order of the families."""
    total = sum(sizes.values())
    shares = {family: count * size // total for family, size in sizes.items()}
    rest = sorted(sizes, key=lambda family: -(count * sizes[family] % total))
    for family in rest[: count - sum(shares.values())]:
        shares[family] += 1
    return shares


def _even_shares(sizes: Mapping[str, int], count: int) -> dict[str, int]:
    """Return the share of each family in ``count``, dealt in turn to the families that have more members."""
    shares = dict.fromkeys(sizes, 0)
    while count:
        for family in [family for family, size in sizes.items() if shares[family] < size][:count]:
            shares[family] += 1
            count -= 1
    return shares


def _rank(name: str, seed: int) -> bytes:
    return hashlib.sha256(f"{seed}:{name}".encode(errors="surrogateescape")).digest()
