"""General mechanical systems: valid arguments, and overlapping contacts."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import Laws, ProblemError
from proxbench.problems.motion.bodies.system import MAX_PATTERNS, ActiveContacts, MechanicalSystem


def two_blocks(**changes: Any) -> MechanicalSystem:
    """Two unit masses above one floor; q holds their heights."""
    given: dict[str, Any] = {
        "mass": lambda position: np.eye(2),
        "force": lambda position, velocity: np.full(2, -10.0),
        "gap": lambda position: position,
        "directions": lambda position: np.eye(2),
        "friction": [0.0, 0.0],
        "restitution_normal": [0.5, 1.0],
        "restitution_tangential": [0.0, 0.0],
        "rows_per_contact": 1,
    }
    return MechanicalSystem(**(given | changes))


@pytest.mark.parametrize("name", ["restitution_normal", "restitution_tangential"])
@pytest.mark.parametrize("values", [[0.5, 1.01], [-0.01, 0.5], [0.5], [0.5, np.nan]])
def test_a_coefficient_of_restitution_lies_between_0_and_1(name: str, values: list[float]) -> None:
    two_blocks(**{name: [0.0, 1.0]})
    with pytest.raises(ProblemError, match=f"{name} must be 2 numbers between 0 and 1"):
        two_blocks(**{name: values})


def test_all_overlaps_are_reported_if_one_exceeds_the_tolerance() -> None:
    system, position = two_blocks(), np.array([-0.2, -0.1])
    assert system.overlaps(position, 0.2) is None
    found = system.overlaps(position, 0.15)
    assert found is not None
    assert found.gap.tolist() == [-0.2, -0.1]
    only_one = system.overlaps(np.array([0.1, -0.1]), 0.0)
    assert only_one is not None
    assert only_one.gap.tolist() == [-0.1]
    assert only_one.normals.to_csc().toarray().tolist() == [[0.0], [1.0]]


def test_gaps_below_a_limit_keep_the_keys_of_their_contacts() -> None:
    keys, gaps = two_blocks().gaps_below(np.array([0.3, 0.1]), 0.2)
    assert (keys.tolist(), gaps.tolist()) == ([1], [0.1])


def test_a_step_has_the_contacts_that_are_closed_at_its_midpoint() -> None:
    step = two_blocks().assemble(np.array([0.3, -0.1]), np.array([1.0, 2.0]), 0.1)
    assert step.free_motion == pytest.approx([0.0, 1.0])
    assert step.contacts is not None
    assert step.contacts.keys.tolist() == [1]
    assert step.contacts.restitution.tolist() == [1.0]
    assert two_blocks().assemble(np.array([0.3, 0.0]), np.zeros(2), 0.1).contacts is None


def test_cache_of_contact_patterns_is_bounded() -> None:
    count = 8
    system = two_blocks(
        mass=lambda position: np.eye(count),
        force=lambda position, velocity: np.zeros(count),
        directions=lambda position: np.eye(count),
        friction=np.zeros(count),
        restitution_normal=np.linspace(0.0, 1.0, count),
        restitution_tangential=np.zeros(count),
    )
    for pattern in [*range(1, 2**count), 1]:
        closed = np.array([bool(pattern & 1 << number) for number in range(count)])
        contacts = system.assemble(np.where(closed, -1.0, 1.0), np.zeros(count), 0.1).contacts
        assert contacts is not None
        assert np.array_equal(contacts.keys, np.flatnonzero(closed))
        assert np.array_equal(contacts.restitution, np.linspace(0.0, 1.0, count)[closed])
    assert len(system._active) == MAX_PATTERNS


@pytest.mark.parametrize(("counts", "first"), [(None, [0, 3, 6]), ([3, 1, 3], [0, 3, 4]), ([1, 1, 3], [0, 1, 2])])
def test_rows_of_contacts_follow_each_other(counts: list[int] | None, first: list[int]) -> None:
    """A contact has as many rows as its count, or as the widest one without counts; the first one is its normal row."""
    laws = Laws.concatenate([Laws.contacts(0.0 if rows == 1 else 0.5, rows, 1) for rows in counts or [3, 3, 3]])
    given = None if counts is None else np.array(counts)
    directions = sp.csc_array((1, laws.n_rows))
    contacts = ActiveContacts(np.arange(3), np.zeros(3), laws, directions, np.zeros(laws.n_rows), 3, given)
    rows = np.arange(1.0, laws.n_rows + 1.0)
    assert contacts.first_rows.tolist() == first
    assert contacts.normals(rows).tolist() == [row + 1.0 for row in first]
    assert contacts.is_contact.all()
    assert np.array_equal(contacts.rows(contacts.lanes(rows)), rows)


@pytest.mark.parametrize("changes", [{"rows_per_contact": 2.5}, {"rows_per_contact": [2, 1.5]}, {"joint_rows": [0.5]}])
def test_numbers_of_rows_are_not_rounded(changes: dict[str, Any]) -> None:
    with pytest.raises(ProblemError, match="must be a whole number"):
        two_blocks(**changes)
