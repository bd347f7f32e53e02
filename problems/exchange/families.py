"""Families of problems, which group them in tables and samples."""

import hashlib
import re
from collections.abc import Mapping
from functools import cache
from typing import Literal, get_args

import numpy as np

from ..contact.problem import ContactProblem
from ..errors import ProblemError, suggestion
from ..hard import CASE_GROUPS
from .catalog import BODY_GROUPS, SEQUENCE_MEMBERS

FAMILY = "family"
"""Key of the provenance of a problem under which the name of its family is stored."""

Sampling = Literal["proportional", "even"]
"""How a sample is divided among families: in proportion to their sizes, or equally."""


def family_of(problem: str | ContactProblem) -> str:
    """Return the family of a problem.

    An entry of the provenance may name the family. Otherwise the name of the problem determines the family: the group
    of a hard case or of a problem of the suite ``bodies`` (``"hard: stacks"``, ``"bodies: arches"``), the sequence of
    a step, or else the part of the name before the first dash or parenthesis (``"funnel"``).
    """
    if not isinstance(problem, str):
        family = problem.provenance.get(FAMILY)
        return str(family) if family else family_of(problem.name)
    return _grouped_families().get(problem) or re.split("[-(]", problem, maxsplit=1)[0] or problem


def check_sampling(count: object, sampling: object) -> None:
    """Raise ``ProblemError`` unless the size is None or an integer from 1 to 2**63 − 1, and the kind is known."""
    if not isinstance(sampling, str) or sampling not in get_args(Sampling):
        raise ProblemError(f"`sampling` {sampling!r:.60} is unknown{suggestion(str(sampling), get_args(Sampling))}")
    if count is None:
        return
    if not isinstance(count, int | np.integer) or count >= 2**63:
        raise ProblemError(
            f"`sample` must be a whole number below 2**63, got {count!r:.60}; omit it to take all problems."
        )
    if count < 1:
        raise ProblemError(f"`sample` must be at least 1, got {count}; omit it to take all problems.")


def sampled(families: Mapping[str, str], count: int, seed: int, sampling: Sampling = "proportional") -> list[str]:
    """Return the names of ``count`` problems in the given order, or all names if there are fewer.

    "proportional" rounds the share of each family by the largest-remainder method. "even" takes the same number from
    each family, and all members of smaller families. In both cases, the members with the smallest SHA-256 hashes of
    ``seed`` and name are chosen. The sample is the same on all machines, and changes little when problems are added.

    Args:
        families: the family of each problem, by name.
        count: size of the sample.
        seed: seed of the sample.
        sampling: "proportional" or "even".

    Raises:
        ProblemError: if ``count`` is not positive, or ``sampling`` is unknown.
    """
    check_sampling(count, sampling)
    members: dict[str, list[str]] = {}
    for name, family in families.items():
        members.setdefault(family, []).append(name)
    chosen: set[str] = set()
    family_sizes = {family: len(names) for family, names in members.items()}
    compute_shares = _proportional_shares if sampling == "proportional" else _even_shares
    for family, share in compute_shares(family_sizes, min(count, len(families))).items():
        chosen |= set(sorted(members[family], key=lambda name: _sort_key(name, seed))[:share])
    return [name for name in families if name in chosen]


@cache
def _grouped_families() -> Mapping[str, str]:
    hard = {name: f"hard: {group}" for group, members in CASE_GROUPS.items() for name in members}
    bodies = {f"bodies-{name}": f"bodies: {group}" for group, members in BODY_GROUPS.items() for name in members}
    steps = {step: f"sequence: {name}" for name, members in SEQUENCE_MEMBERS.items() for step in members}
    return hard | bodies | steps


def _proportional_shares(family_sizes: Mapping[str, int], count: int) -> dict[str, int]:
    """Return the number for each family by the largest-remainder method; ties go to the earlier family."""
    total = sum(family_sizes.values())
    shares = {family: count * size // total for family, size in family_sizes.items()}
    by_remainder = sorted(family_sizes, key=lambda family: -(count * family_sizes[family] % total))
    for family in by_remainder[: count - sum(shares.values())]:
        shares[family] += 1
    return shares


def _even_shares(family_sizes: Mapping[str, int], count: int) -> dict[str, int]:
    """Return the number for each family, as equal as the sizes allow."""
    shares = dict.fromkeys(family_sizes, 0)
    while count:
        for family in [family for family, size in family_sizes.items() if shares[family] < size][:count]:
            shares[family] += 1
            count -= 1
    return shares


def _sort_key(name: str, seed: int) -> bytes:
    return hashlib.sha256(f"{seed}:{name}".encode(errors="surrogateescape")).digest()
