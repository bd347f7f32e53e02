"""What a stored run and a stored case look like, checked before anything believes a file.

Files may come from elsewhere: a checksum shows that they are whole, not that they are honest.
"""

import re
from collections.abc import Callable
from typing import Any

from .outcome import Outcome

_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that steer a terminal, turn text around, or are halves that no file can hold."""

_OUTCOMES = {outcome.value for outcome in Outcome}

Check = Callable[[Any], bool]


def printable(value: Any) -> Any:
    """Return a JSON value whose texts can be shown anywhere."""
    if isinstance(value, str):
        return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", value)
    if isinstance(value, dict):
        return {printable(key): printable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [printable(item) for item in value]
    return value


def info_fault(info: dict[str, Any]) -> str | None:
    """Say what of ``run.json`` is not as it should be, or None."""
    return _fault(info, _RUN) or _fault(info["plan"], _PLAN)


def case_fault(case: dict[str, Any]) -> str | None:
    """Say what of a case's file is not as it should be, or None."""
    fault = _fault(case, _CASE) or _fault(case["curve"], _CURVE)
    if fault is None and len(case["curve"]["iteration"]) != len(case["curve"]["residual"]):
        fault = "curve"
    for point in case["points"] if fault is None else ():
        fault = fault or _fault(point, _POINT)
        if fault is None and "verdict" in point:
            fault = _fault(point, _MEASURED)
    return fault


def _fault(found: dict[str, Any], checks: dict[str, Check]) -> str | None:
    return next((key for key, check in checks.items() if key not in found or not check(found[key])), None)


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63


def _is_number_or_null(value: Any) -> bool:
    return value is None or _is_number(value)


def _is_object(value: Any) -> bool:
    return isinstance(value, dict)


def _list_of(check: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


def _dict_of(check: Check) -> Check:
    return lambda value: isinstance(value, dict) and all(map(check, value.values()))


_RUN: dict[str, Check] = {
    "run_id": _is_text,
    "plan": _is_object,
    "machine": _is_object,
    "calibration_seconds": _list_of(_is_number),
    "plugins": _list_of(_dict_of(_is_text)),
    "started": _is_text,
    "finished": _is_text,
}

_PLAN: dict[str, Check] = {
    "problems": _list_of(_is_text),
    "solvers": _list_of(_is_text),
    "tolerances": _list_of(_is_number),
    "limits": lambda value: (
        _dict_of(_is_number)(value)
        and set(value) == {"solve_seconds", "case_seconds", "memory_bytes", "max_iterations"}
    ),
}

_CASE: dict[str, Check] = {
    **dict.fromkeys(("problem", "digest", "solver", "model", "reason", "traceback", "stderr"), _is_text),
    "has_iterates": lambda value: isinstance(value, bool),
    "n_rows": _is_count,
    "n_contacts": _is_count,
    "outcome": lambda value: isinstance(value, str) and value in _OUTCOMES,
    "wall_seconds": _is_number,
    "peak_memory_bytes": _is_count,
    "curve": _is_object,
    "points": _list_of(_is_object),
}

_CURVE: dict[str, Check] = {"iteration": _list_of(_is_count), "residual": _list_of(_is_number_or_null)}

_POINT: dict[str, Check] = {
    "tolerance": _is_number,
    "outcome": lambda value: isinstance(value, str) and value in _OUTCOMES,
    "status": _is_text,
    "reason": _is_text,
}

_MEASURED: dict[str, Check] = {
    "iterations": _is_count,
    "repeats": _is_count,
    **dict.fromkeys(("residual", "model_residual", "impulse_error"), _is_number_or_null),
    **dict.fromkeys(("prepare_seconds", "solve_seconds", "total_seconds"), _dict_of(_is_number)),
    "verdict": _dict_of(lambda value: isinstance(value, bool) or _is_number_or_null(value)),
}
