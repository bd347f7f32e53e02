"""Time limits that other programs on the same core exceed, such as tests that run in parallel."""

import math

import pytest
from proxbench.bench.measure import measuring_core, timed_round
from proxbench.bench.measure.contacts import clock_account, control
from proxbench.bench.store import notes

LIMITS = {
    "measure.measuring_core.MAX_PROBE_RATIO": measuring_core.MAX_PROBE_RATIO,
    "measure.timed_round.TOLERATED_SECONDS": timed_round.TOLERATED_SECONDS,
    "measure.contacts.control.MAX_ALLOWANCE_SECONDS": control.MAX_ALLOWANCE_SECONDS,
    "measure.contacts.clock_account.ALLOWANCE_SECONDS": clock_account.ALLOWANCE_SECONDS,
    "store.notes.ALLOWANCE_SECONDS": notes.ALLOWANCE_SECONDS,
}
"""The limits of a run by their names in ``bench``."""


def ignore_load(patch: pytest.MonkeyPatch) -> None:
    """Disable these limits, so that load excludes no round, accuses no solver and repeats no solve."""
    for name in LIMITS:
        patch.setattr(f"proxbench.bench.{name}", math.inf)


def restore_limits(patch: pytest.MonkeyPatch, *names: str) -> None:
    """Restore some limits of a run."""
    for name in names:
        patch.setattr(f"proxbench.bench.{name}", LIMITS[name])
