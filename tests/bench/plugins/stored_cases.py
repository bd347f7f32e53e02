"""Records of cases for tests, with what matters given and the rest as simple as it can be."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from proxbench.bench.measure.points import quartiles
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.records import CaseRecord, Curve, Measured, Round


def timed_round(number: int, seconds: float, **others: Any) -> Round:
    """Return a round of the first session that nothing disturbed, all of it solving."""
    plain = {"session": 0, "prepare_seconds": 0.0, "repeats": 1, "cpu": 1.0}
    return Round(**{**plain, "number": number, "solve_seconds": seconds, "total_seconds": seconds, **others})


def measured_in(rounds: Sequence[Round], **others: Any) -> Measured:
    """Return what was measured in rounds, solved to 1e-7."""
    times = quartiles(np.array([one.total_seconds for one in rounds]))
    plain = {"iterations": 3, "residual": 1e-7, "model_residual": 1e-7, "verdict": {}, "impulse_error": None}
    spent = {"prepare_seconds": times, "solve_seconds": times, "total_seconds": times}
    repeats = sum(one.repeats for one in rounds)
    return Measured(**{**plain, **spent, "repeats": repeats, "rounds": list(rounds), **others})


def case_record(**others: Any) -> CaseRecord:
    """Return a measured case of one spatial contact without points."""
    plain = {
        "problem": "p",
        "digest": "0",
        "solver": "S",
        "model": "coulomb",
        "has_iterates": True,
        "n_rows": 3,
        "n_contacts": 1,
        "outcome": Outcome.MEASURED,
        "reason": "",
        "traceback": "",
        "stderr": "",
        "wall_seconds": 1.5,
        "peak_memory_bytes": 2**40,
        "curve": Curve(),
        "points": [],
    }
    return CaseRecord(**{**plain, **others})
