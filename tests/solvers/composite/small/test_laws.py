"""The arguments of the kernels are the arrays of the laws and of their layout."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import Laws, load
from proxbench.problems.contact.blocks import BlockLayout
from proxbench.solvers.composite.small.laws import law_arguments


@given(seed=st.integers(0, 2**32 - 1), n_contacts=st.integers(1, 12), dim=st.integers(1, 3))
def test_arguments_of_the_kernel_are_the_arrays_of_laws_and_layout(seed: int, n_contacts: int, dim: int) -> None:
    rng = np.random.default_rng(seed)
    laws = Laws.contacts(rng.uniform(0.0, 1.2, size=n_contacts), dim, n_contacts)
    layout, found = BlockLayout.of(laws), law_arguments(laws)
    of_laws = laws.sets, laws.row_count, laws.is_rolling, laws.first_row, laws.partner
    of_layout = layout.slot, layout.contact_of_row, layout.partner
    bounds = layout.friction_coefficient, layout.fixed_bound, (layout.width * layout.partner).astype(np.uint64)
    residual = *of_laws[:2], laws.first_row, laws.friction_coefficient, laws.fixed_bound, laws.partner
    assert found is not None
    for arrays, expected in ((found.preparation, (*of_laws, *of_layout)), (found.sweeps, (*bounds, *residual))):
        for array, other in zip(arrays, expected, strict=True):
            assert np.array_equal(array, other)
            assert array.dtype == other.dtype
    assert law_arguments(laws) is found


@pytest.mark.parametrize("name", ["hard-four-bar", "hard-resisting-spheres-30", "hard-mixed-laws"])
def test_the_kernel_takes_no_joints_rolling_friction_or_contacts_of_different_widths(name: str) -> None:
    assert law_arguments(load(name).laws) is None
