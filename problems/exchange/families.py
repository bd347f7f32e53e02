"""Families of problems, by which tables and samples group them."""

import hashlib
import re
from collections.abc import Mapping
from functools import cache

from ..contact.problem import ContactProblem
from ..errors import ProblemError
from ..hard import CASE_GROUPS

FAMILY = "family"
"""Key of the family in the provenance of a problem."""


def family_of(problem: str | ContactProblem) -> str:
    """Return the family of a problem.

    That of a problem is what its provenance says. Without it, and for a name: the group of a hard case
    (``"hard: stacks"``), else what precedes the first dash, or the options of a scene, in the name (``"funnel"``).
    """
    if not isinstance(problem, str):
        named = problem.provenance.get(FAMILY)
        return str(named) if named else family_of(problem.name)
    return _hard_families().get(problem) or re.split("[-(]", problem, maxsplit=1)[0] or problem


def sampled(families: Mapping[str, str], count: int, seed: int) -> list[str]:
    """Return ``count`` of the problems, families in proportion, in their order; all if there are no more.

    Each family has its share rounded up or down (by largest remainders). Its members are those whose names have the
    least SHA-256 together with ``seed``: the same on every machine, and almost the same when problems are added.

    Args:
        families: the family of each problem, by name.
        count: size of the sample.
        seed: seed of the sample.

    Raises:
        ProblemError: if ``count`` is not positive.
    """
    if count < 1:
        raise ProblemError(f"a sample must have at least one problem, got {count}.")
    members: dict[str, list[str]] = {}
    for name, family in families.items():
        members.setdefault(family, []).append(name)
    chosen: set[str] = set()
    sizes = {family: len(names) for family, names in members.items()}
    for family, share in _shares(sizes, min(count, len(families))).items():
        chosen |= set(sorted(members[family], key=lambda name: _rank(name, seed))[:share])
    return [name for name in families if name in chosen]


@cache
def _hard_families() -> Mapping[str, str]:
    return {name: f"hard: {group}" for group, members in CASE_GROUPS.items() for name in members}


def _shares(sizes: Mapping[str, int], count: int) -> dict[str, int]:
    """Return how many of ``count`` each family gets, by largest remainders; equal ones in the order of the families."""
    total = sum(sizes.values())
    shares = {family: count * size // total for family, size in sizes.items()}
    rest = sorted(sizes, key=lambda family: -(count * sizes[family] % total))
    for family in rest[: count - sum(shares.values())]:
        shares[family] += 1
    return shares


def _rank(name: str, seed: int) -> bytes:
    return hashlib.sha256(f"{seed}:{name}".encode(errors="surrogateescape")).digest()
