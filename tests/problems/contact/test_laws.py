"""Laws are consistent, and inconsistencies are named."""

import gc
import weakref
from dataclasses import fields

import numpy as np
import pytest
from proxbench.problems import LawKind, Laws, ProblemError
from proxbench.problems.contact.blocks import BlockLayout, layout_of, write_layout
from proxbench.problems.contact.matrices import memory
from proxbench.problems.errors import InsufficientMemoryError


def planar_contact(**changes: object) -> Laws:
    arrays = {
        "kind": [0, 1],
        "first_row": [0, 1],
        "friction_coefficient": [0.0, 0.3],
        "fixed_bound": [0.0, 0.0],
        "partner": [-1, 0],
    }
    return Laws(**{name: np.array(value) for name, value in {**arrays, **changes}.items()})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": [0, 7]}, r"laws.kind\[1\] = 7"),
        ({"first_row": [0, 2]}, r"laws.first_row\[1\] = 2"),
        ({"friction_coefficient": [0.0, -0.3]}, r"friction_coefficient\[1\] = -0.3"),
        ({"friction_coefficient": [0.0, np.nan]}, r"friction_coefficient\[1\] = nan"),
        ({"friction_coefficient": [0.3, 0.3]}, r"friction_coefficient\[0\] = 0.3"),
        ({"fixed_bound": [0.0, np.inf]}, r"fixed_bound\[1\] = inf"),
        ({"partner": [-1, 5]}, r"partner\[1\] = 5"),
        ({"partner": [-1, 1]}, r"partner\[1\] = 1 must be the index of a unilateral law"),
        ({"partner": [0, 0]}, r"partner\[0\] = 0"),
        ({"partner": [-1, -1]}, "without a partner"),
        ({"partner": [-1]}, r"shape \(2,\)"),
    ],
)
def test_a_contradiction_names_field_index_and_value(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        planar_contact(**changes)


def test_arrays_are_copies_and_cannot_be_written() -> None:
    kind = np.array([0, 1])
    laws = planar_contact(kind=kind)
    kind[1] = 2
    assert laws.kind[1] == 1
    with pytest.raises(ValueError, match="read-only"):
        laws.friction_coefficient[1] = 9.0
    for made in (laws, Laws.contacts(0.3, 3, 2), Laws.contacts(0.3, 3, 2).fresh()):
        for name in ("sets", "row_count", "is_friction", "is_rolling", "is_unilateral", "is_bilateral"):
            assert not getattr(made, name).flags.writeable, name


@pytest.mark.parametrize(("dim", "laws", "rows"), [(1, 4, 4), (2, 8, 8), (3, 8, 12)])
def test_equal_contacts_have_their_rows_in_the_order_normal_then_tangents(dim: int, laws: int, rows: int) -> None:
    made = Laws.contacts([0.1, 0.2, 0.3, 0.4], dim, 4)
    assert (made.n_laws, made.n_rows) == (laws, rows)
    assert made.friction_coefficient[made.is_friction].tolist() == ([0.1, 0.2, 0.3, 0.4] if dim > 1 else [])


@pytest.mark.parametrize(
    ("friction", "dim", "words"),
    [
        (0.3, 4, "dim"),
        (0.3, "3", "dim"),
        ([0.1], 3, None),
        ([0.1, 0.2], 3, "shape"),
        (-0.1, 3, r"friction\[0\]"),
        ([0.1, -0.2, -0.3], 3, r"friction\[1\] = -0.2 must"),
    ],
)
def test_equal_contacts_check_their_arguments(friction: object, dim: int, words: str | None) -> None:
    if words is None:
        assert Laws.contacts(friction, dim, 3).n_laws == 6  # type: ignore[arg-type]
        return
    with pytest.raises(ProblemError, match=words):
        Laws.contacts(friction, dim, 3)  # type: ignore[arg-type]


def rolling_contact(**changes: object) -> Laws:
    arrays = {
        "kind": [LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION, LawKind.SPATIAL_ROLLING],
        "first_row": [0, 1, 3],
        "friction_coefficient": [0.0, 0.3, 0.01],
        "fixed_bound": [0.0, 0.0, 0.0],
        "partner": [-1, 0, 0],
    }
    return Laws(**{name: np.array(value) for name, value in {**arrays, **changes}.items()})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"partner": [-1, 0, -1], "friction_coefficient": [0.0, 0.3, 0.0]},
            r"partner\[2\] = -1 must be the preceding unilateral",
        ),
        (
            {"partner": [-1, -1, 0], "friction_coefficient": [0.0, 0.0, 0.1]},
            r"partner\[2\] = 0 must be the preceding unilateral",
        ),
        ({"kind": [0, 3, 5], "first_row": [0, 1, 2]}, r"friction_coefficient\[1\] = 0.3 must be 0 for a law without"),
        ({"kind": [3, 2, 5]}, r"partner\[1\] = 0 must be the index of a unilateral law"),
    ],
)
def test_rolling_friction_stands_behind_its_own_contact(changes: dict[str, object], words: str) -> None:
    assert rolling_contact().n_rows == 5
    with pytest.raises(ProblemError, match=words):
        rolling_contact(**changes)


def test_rolling_friction_is_added_behind_each_contact_and_nothing_else_changes() -> None:
    contacts = Laws.concatenate([Laws.contacts([0.1, 0.2], 3, 2), Laws.joints(2), Laws.contacts(0.0, 1, 1)])
    made = contacts.with_rolling([0.01, 0.02, 0.03], 3)
    assert made.kind.tolist() == [0, 2, 6, 0, 2, 6, 3, 3, 0, 6]
    assert made.partner.tolist() == [-1, 0, 0, -1, 3, 3, -1, -1, -1, 8]
    assert made.friction_coefficient.tolist() == [0, 0.1, 0.01, 0, 0.2, 0.02, 0, 0, 0, 0.03]
    assert made.n_rows == contacts.n_rows + 9
    with pytest.raises(ProblemError, match="already"):
        made.with_rolling(0.1, 1)
    with pytest.raises(ProblemError, match=r"one for each of the 3 unilateral laws, got shape \(2,\)"):
        contacts.with_rolling([0.1, 0.2], 1)
    with pytest.raises(ProblemError, match="1, 2 or 3 rows"):
        contacts.with_rolling(0.1, 4)


def test_lanes_of_a_block_are_normal_sliding_and_rolling_rows() -> None:
    laws = Laws.concatenate(
        [Laws.contacts([0.3], 2, 1), Laws.joints(1), Laws.contacts([0.1], 3, 1).with_rolling(0.01, 2)]
    )
    layout = layout_of(laws)
    assert (layout.width, layout.sliding, layout.rolling) == (5, 2, 2)
    # in kernels that run as Python, products of NumPy integers with narrower ones would be wider
    assert type(layout.width) is type(layout.sliding) is int
    assert layout.slot.tolist() == [0, 1, 5, 10, 11, 12, 13, 14]
    assert layout.is_bilateral.tolist() == [False, True, False]
    assert layout.rolling_coefficient.tolist() == [0.0, 0.0, 0.01]
    assert layout.rolling_law.tolist() == [-1, -1, 5]
    assert not layout.has_contacts_only
    assert layout_of(Laws.contacts([0.3], 2, 1)).has_contacts_only


def test_the_layout_of_blocks_does_not_depend_on_what_its_memory_held() -> None:
    """A frictionless contact has no bound and no partner but itself, and a contact is no joint."""
    laws = Laws.concatenate([Laws.contacts([0.0], 1, 1), Laws.contacts([0.3], 3, 1).with_rolling(0.01, 2)])
    given = laws.sets, laws.row_count, laws.is_rolling, laws.partner, laws.friction_coefficient, laws.fixed_bound
    layout = layout_of(laws)
    numbers, bounds, is_bilateral = np.full((5, 4), 7), np.full((4, 4), 7.0), np.ones(4, np.bool_)
    write_layout(*given, np.full(laws.n_rows, 7), numbers, bounds, is_bilateral)
    assert numbers[:4, :2].tolist() == [[0, 1], [-1, 2], [-1, 3], [0, 1]]
    assert bounds[:, :2].tolist() == [[0.0, 0.3], [0.0, 0.0], [0.0, 0.01], [0.0, 0.0]]
    assert is_bilateral[:2].tolist() == [False, False] == layout.is_bilateral.tolist()


def test_fresh_laws_are_equal_and_share_no_memory() -> None:
    laws = Laws.contacts([0.5, 0.3], 3, 2).with_rolling(0.1, 3)
    fresh = laws.fresh()
    for name, array in vars(fresh).items():
        assert np.array_equal(array, getattr(laws, name))
        assert not np.shares_memory(array, getattr(laws, name))
        assert not array.flags.writeable
    assert len(vars(fresh)) >= 5


def test_the_laws_of_few_equal_contacts_are_made_once() -> None:
    assert Laws.contacts(0.25, 3, 7) is Laws.contacts(0.25, 3, 7)
    assert Laws.contacts(0.25, 3, 7) is not Laws.contacts(0.25, 2, 7)
    assert Laws.contacts(0.25, 2, 7).friction_coefficient[1] == 0.25


def test_laws_of_many_equal_contacts_are_kept_only_while_they_are_in_use() -> None:
    """Those of a thousand contacts are kept longer than those of 5000, because they take less memory."""
    assert Laws.contacts(0.125, 3, 1000) is Laws.contacts(0.125, 3, 1000)
    for n_contacts, n_others in ((1000, 70), (5000, 20)):
        reference = weakref.ref(Laws.contacts(0.125, 3, n_contacts))
        for number in range(n_others):
            Laws.contacts(0.5 + 0.01 * number, 3, n_contacts)
        gc.collect()
        assert reference() is None


def test_counts_name_each_kind_of_law_that_occurs() -> None:
    laws = Laws.concatenate([Laws.contacts(0.5, 3, 4), Laws.joints(2)])
    assert laws.counts() == {"unilateral": 4, "spatial friction": 4, "bilateral": 2}
    assert laws.summary == "4 unilateral, 4 spatial friction, 2 bilateral"


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize("n_contacts", [0, 1, 70, 128])
def test_equal_contacts_have_the_layout_of_their_own_laws(dim: int, n_contacts: int) -> None:
    """The layout is taken from that of a longer list of equal contacts."""
    laws = Laws.contacts(0.3, dim, n_contacts)
    found, expected = layout_of(laws), BlockLayout.of(laws.fresh())
    for one in fields(BlockLayout):
        assert np.array_equal(getattr(found, one.name), getattr(expected, one.name)), one.name
    for name in ("sets", "row_count", "is_friction", "is_rolling", "is_unilateral", "is_bilateral"):
        assert np.array_equal(getattr(laws, name), getattr(laws.fresh(), name)), name
    assert laws.kinds == laws.fresh().kinds == set(laws.fresh().kind.tolist())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": [0, 257]}, r"laws.kind\[1\] = 257"),
        ({"kind": [0, 1.5]}, r"laws.kind\[1\] = 1.5"),
        ({"partner": [-1, 0.5]}, r"laws.partner\[1\] = 0.5"),
        ({"kind": 0}, r"laws.kind must have shape \(n_laws,\), one entry per law; got \(\)"),
    ],
)
def test_numbers_that_are_not_indices_or_kinds_are_reported_instead_of_rounded(
    changes: dict[str, object], words: str
) -> None:
    with pytest.raises(ProblemError, match=words):
        planar_contact(**changes)


@pytest.mark.parametrize("kind", [[9], [-1], [300], [0.5]])
def test_laws_in_order_report_an_unknown_kind(kind: list[float]) -> None:
    with pytest.raises(ProblemError, match=r"laws.kind\[0\]"):
        Laws.in_order(kind, np.zeros(1), np.zeros(1), np.full(1, -1))


@pytest.mark.parametrize("n_contacts", [-1, 2.0, "2"])
def test_the_number_of_contacts_is_a_whole_number_of_at_least_zero(n_contacts: object) -> None:
    with pytest.raises(ProblemError, match="n_contacts"):
        Laws.contacts(0.5, 3, n_contacts)  # type: ignore[arg-type]


def test_negative_zero_friction_does_not_change_the_cached_laws() -> None:
    Laws.contacts(-0.0, 3, 61)
    assert not np.signbit(Laws.contacts(0.0, 3, 61).friction_coefficient).any()


def test_laws_that_memory_does_not_hold_are_refused_before_they_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "available_bytes", lambda: 1e10)
    for friction in (0.5, [0.5]):
        with pytest.raises(InsufficientMemoryError, match=r"for the laws of .* contacts"):
            Laws.contacts(friction, 3, 2**31 - 1)
    with pytest.raises(InsufficientMemoryError, match="for the laws of 2,147,483,647 rows of joints"):
        Laws.joints(2**31 - 1)


def test_laws_are_concatenated_from_any_iterable() -> None:
    parts = [Laws.joints(2), Laws.contacts(0.5, 3, 1)]
    for given in (parts, tuple(parts), iter(parts), dict.fromkeys(parts)):
        assert Laws.concatenate(given).kind.tolist() == [3, 3, 0, 2]
    for odd in (iter(()), iter([1]), 3, None):
        with pytest.raises(ProblemError, match="takes a list of at least one Laws"):
            Laws.concatenate(odd)  # type: ignore[arg-type]
