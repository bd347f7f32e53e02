"""Laws hold together, and what does not is named."""

import numpy as np
import pytest
from proxbench.problems import Laws, ProblemError


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
        ({"kind": [0, 3]}, r"laws.kind\[1\] = 3"),
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


@pytest.mark.parametrize(("dim", "laws", "rows"), [(1, 4, 4), (2, 8, 8), (3, 8, 12)])
def test_equal_contacts_have_their_rows_in_the_order_normal_then_tangents(dim: int, laws: int, rows: int) -> None:
    made = Laws.contacts([0.1, 0.2, 0.3, 0.4], dim, 4)
    assert (made.n_laws, made.n_rows) == (laws, rows)
    assert made.friction_coefficient[made.is_friction].tolist() == ([0.1, 0.2, 0.3, 0.4] if dim > 1 else [])


@pytest.mark.parametrize(
    ("friction", "dim", "words"),
    [(0.3, 4, "dim"), (0.3, "3", "dim"), ([0.1], 3, None), ([0.1, 0.2], 3, "shape"), (-0.1, 3, r"friction\[0\]")],
)
def test_equal_contacts_check_their_arguments(friction: object, dim: int, words: str | None) -> None:
    if words is None:
        assert Laws.contacts(friction, dim, 3).n_laws == 6  # type: ignore[arg-type]
        return
    with pytest.raises(ProblemError, match=words):
        Laws.contacts(friction, dim, 3)  # type: ignore[arg-type]
