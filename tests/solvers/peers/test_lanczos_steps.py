"""The number of Lanczos steps of Pinocchio's ADMM fits into the time limit."""

import numpy as np
import pytest
from proxbench.solvers.peers.pinocchio_admm import LANCZOS_SHARE, STEP_SECONDS, lanczos_steps


@pytest.mark.parametrize(("wanted", "n_rows", "expected"), [(0, 366, 366), (10, 366, 10), (500, 366, 366), (0, 12, 12)])
def test_requested_steps_are_taken_if_time_permits(wanted: int, n_rows: int, expected: int) -> None:
    assert lanczos_steps(wanted, n_rows, 0.5) == lanczos_steps(wanted, n_rows, np.inf) == expected


@pytest.mark.parametrize("max_seconds", [0.1, 0.5, 5.0])
@pytest.mark.parametrize("wanted", [0, 4000])
def test_steps_that_do_not_fit_are_left_out(wanted: int, max_seconds: float) -> None:
    steps = lanczos_steps(wanted, 5022, max_seconds)
    assert steps < (wanted or 5022)
    assert steps**2 * 5022 * STEP_SECONDS <= LANCZOS_SHARE * max_seconds
    assert lanczos_steps(wanted, 5022, 2.0 * max_seconds) > steps


def test_two_steps_are_always_taken() -> None:
    assert lanczos_steps(0, 10**9, 1e-9) == 2
