"""The kernels of small problems lay out laws as the classes do that lay out those of any problem."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import Laws, load
from proxbench.problems.contact.blocks import BlockLayout
from proxbench.solvers.composite.small.laws import ContactLaws, lay_out_contacts


def laid_out(laws: Laws) -> tuple[bool, ContactLaws]:
    """Return the result of the kernel for some laws."""
    result: tuple[bool, ContactLaws] = lay_out_contacts(
        laws.kind, laws.partner, laws.friction_coefficient, laws.fixed_bound
    )
    return result


@given(seed=st.integers(0, 2**32 - 1), n_contacts=st.integers(1, 12), dim=st.integers(1, 3))
def test_arrays_of_contacts_are_those_of_laws_and_layout(seed: int, n_contacts: int, dim: int) -> None:
    rng = np.random.default_rng(seed)
    laws = Laws.contacts(rng.uniform(0.0, 1.2, size=n_contacts), dim, n_contacts)
    if dim > 1:
        laws = dataclasses.replace(laws, fixed_bound=np.where(laws.partner >= 0, rng.uniform(size=len(laws.kind)), 0.0))
    layout, (are_equal_contacts, arrays) = BlockLayout.of(laws), laid_out(laws)
    expected = ContactLaws(
        laws.sets,
        laws.row_count,
        laws.is_rolling,
        laws.first_row,
        laws.partner,
        laws.friction_coefficient,
        laws.fixed_bound,
        layout.slot,
        layout.contact_of_row,
        layout.partner,
        layout.friction_coefficient,
        layout.fixed_bound,
        (layout.width * layout.partner).astype(np.uint64),
    )
    assert are_equal_contacts
    for array, other in zip(arrays, expected, strict=True):
        assert np.array_equal(array, other)
        assert array.dtype == other.dtype


@pytest.mark.parametrize("name", ["hard-four-bar", "hard-resisting-spheres-30", "hard-mixed-laws"])
def test_the_kernel_takes_no_joints_rolling_friction_or_contacts_of_different_widths(name: str) -> None:
    are_equal_contacts, _ = laid_out(load(name).laws)
    assert not are_equal_contacts
