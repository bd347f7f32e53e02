"""Any value as an argument of the interface of runs is accepted or refused by one sentence, before anything starts."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from proxbench import solve_many
from proxbench.bench import runs
from proxbench.bench.store.plans import PlanRecord
from proxbench.problems import ProxbenchError, load

PROBLEM = "hard-groove"

ODD: dict[str, Any] = {
    "None": None,
    "text": "abc",
    "no text": "",
    "nan": float("nan"),
    "infinity": np.inf,
    "negative": -1,
    "fraction": 1.5,
    "huge integer": 10**400,
    "complex": 1j,
    "boolean": True,
    "number of numpy": np.int64(3),
    "number of numpy with a fraction": np.float32(0.5),
    "list": [],
    "list of numbers": [3],
    "mapping": {},
    "object": object(),
    "array": np.zeros(3),
}


def run_with(name: str) -> Callable[[Any], object]:
    return lambda odd: runs.run(PROBLEM, "NSGS", **{name: odd})


def study_with(name: str) -> Callable[[Any], object]:
    return lambda odd: runs.study("stack", **{name: odd})


CALLS: dict[str, Callable[[Any], object]] = {
    "problems": lambda odd: runs.run(odd, "NSGS"),
    "solvers": lambda odd: runs.run(PROBLEM, odd),
    "suite": lambda odd: runs.run(None, "NSGS", suite=odd),
    "scene": runs.study,
    **{name: run_with(name) for name in ("run_id", "tolerances", "limits", "solve_seconds", "case_seconds", "memory")},
    **{name: run_with(name) for name in ("passes", "seed", "sample", "sampling", "shard")},
    **{f"study, {name}": study_with(name) for name in ("methods", "tolerance", "duration", "members", "start")},
    "problems of solve_many": solve_many,
    "member of solve_many": lambda odd: solve_many([odd]),
    "tolerance of solve_many": lambda odd: solve_many([load(PROBLEM)], tolerance=odd),
    "threads of solve_many": lambda odd: solve_many([load(PROBLEM)], threads=odd),
}


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_value_is_accepted_or_refused_by_one_sentence(
    call: Callable[[Any], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class StartedError(Exception):
        """The arguments are accepted."""

    def measure(plan: Any, *_: object) -> None:
        assert msgspec.json.decode(msgspec.json.encode(plan.record), type=PlanRecord) == plan.record
        raise StartedError

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runs, "measure", measure)
    for odd in ODD.values():
        refusals = []
        try:
            call(odd)
        except StartedError:
            pass
        except ProxbenchError as refusal:
            refusals.append(str(refusal))
        assert not [text for text in refusals if "\n" in text or not text.endswith((".", "?"))]
