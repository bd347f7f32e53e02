"""Keys identify two bodies and a feature, and ascend with them."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.detection.contact_keys import ContactKeys


def test_keys_of_several_contacts_a_pair_ascend_and_give_back_bodies_and_features() -> None:
    keys = ContactKeys(n_bodies=4, n_features=3)
    every = np.indices((4, 4, 3)).reshape(3, -1)
    numbers = keys.encode(*every)
    np.testing.assert_array_equal(np.diff(numbers), 1)
    np.testing.assert_array_equal(keys.decode(numbers), every)


def test_contacts_of_one_pair_share_its_number_and_no_others_do() -> None:
    keys = ContactKeys(n_bodies=4, n_features=3)
    first, second, feature = np.indices((4, 4, 3)).reshape(3, -1)
    pairs = keys.pairs(keys.encode(first, second, feature)).reshape(16, 3)
    assert (pairs == pairs[:, :1]).all()
    assert len(np.unique(pairs)) == 16


@pytest.mark.parametrize("numbers", [(0, 1), (1, 0), (2**31, 2), (2**21, 2**21)])
def test_invalid_numbers_of_bodies_or_features_are_refused(numbers: tuple[int, int]) -> None:
    with pytest.raises(ProblemError, match="63 bits"):
        ContactKeys(*numbers)


def test_as_many_keys_as_fit_into_63_bits_are_admitted() -> None:
    """The pairs of 2³¹ bodies fit with one feature; for one body, features up to 2⁶³ − 1 fit."""
    assert ContactKeys(2**31).encode(2**31 - 1, 2**31 - 1) == 2**62 - 1
    assert ContactKeys(1, 2**63 - 1).encode(0, 0, 2**63 - 2) == 2**63 - 2
