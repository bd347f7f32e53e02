"""How complete a run is, and how steady its machine was: sentences for the head of every report."""

import math
from collections.abc import Mapping

from ...problems.spelling import either
from .frames import JUDGED, RunFrames
from .records import Machine, RunRecord

UNSTEADY = 1.5
"""Drift above which a report warns."""


_HARDWARE = {"processor": "processor", "cores": "cores", "logical_cores": "logical cores"}
"""Fields of a machine by which it is another one, with their names in sentences."""

_COMPARED = {**_HARDWARE, "memory_bytes": "memory [bytes]", "system": "system", "python": "Python"}
"""Fields of a machine that times depend on."""


def drift(run: RunRecord) -> float:
    """Return the longest over the shortest time of the reference workload in a run; NaN where it was timed once."""
    times = [seconds for session in run.sessions for seconds in session.calibration_seconds if seconds > 0.0]
    return max(times) / min(times) if len(times) > 1 else math.nan


def differences(before: Machine, now: Machine) -> list[str]:
    """Return in words what two machines, or the versions and sources on them, differ in; nothing if times compare."""
    found = _changed(_COMPARED, before, now)
    names = sorted(set(before.versions) | set(now.versions))
    versions = ((name, before.versions.get(name, "none"), now.versions.get(name, "none")) for name in names)
    found += [f"{name} {old or 'none'}, now {new or 'none'}" for name, old, new in versions if old != new]
    if before.source != now.source:
        found.append(f"source {_short(before.source)}, now {_short(now.source)}")
    return found


def other_hardware(before: Machine, now: Machine) -> list[str]:
    """Return those of ``differences`` by which the machine itself is another one."""
    return _changed(_HARDWARE, before, now)


def _changed(fields: Mapping[str, str], before: Machine, now: Machine) -> list[str]:
    values = ((word, getattr(before, name), getattr(now, name)) for name, word in fields.items())
    return [f"{word} {_short(old)}, now {_short(new)}" for word, old, new in values if old != new]


def mixtures(run: RunRecord) -> list[str]:
    """Return in words what the sessions of a run differ in from what it was begun on."""
    machines = [session.machine for session in run.sessions if session.machine is not None]
    return list(dict.fromkeys(said for machine in machines for said in differences(run.machine, machine)))


def _short(value: object) -> str:
    return str(value)[:12] if len(str(value)) == 64 else str(value) or "unknown"


def warnings(frames: RunFrames) -> list[str]:
    """Return what a reader must know before the numbers: that cases are missing, that the machine was not steady."""
    found = []
    if not frames.is_finished:
        resume = either(f"proxbench run --resume {frames.folder}", f"proxbench.bench.resume({str(frames.folder)!r})")
        begun = len(frames.cases) - frames.n_finished
        partly = f", {begun} more in part" if begun else ""
        counts = f"{frames.n_finished} of {frames.n_planned} cases"
        found.append(f"UNFINISHED: {counts} are measured{partly}; go on with: {resume}")
    if len(frames.cases) and not frames.is_study and not frames.cases["n_rows"].any():
        found.append("EMPTY: no problem of this run has a contact, so nothing was solved; choose other problems")
    if drift(frames.info) > UNSTEADY:
        found.append(
            f"UNSTEADY: the machine's speed changed by a factor of {drift(frames.info):.2f} during the run; times of "
            "different problems do not compare; measure again on a quiet machine"
        )
    mixed = mixtures(frames.info)
    if mixed:
        found.append(
            f"MIXED: the run was measured in several sessions that differ ({'; '.join(mixed)}); times of different "
            "sessions do not compare; measure again in one"
        )
    return found


def basis(frames: RunFrames) -> list[str]:
    """Say what residuals are relative to, where they are not the judged ones."""
    if frames.residual == JUDGED:
        return []
    return ["residuals are local: the largest violation of a contact relative to what shares a body with it"]


def steadiness(run: RunRecord) -> str:
    """Return drift and load of the machine in one line."""
    loads = [load for session in run.sessions for load in session.load]
    factor = drift(run)
    speed = "drift unknown" if math.isnan(factor) else f"drift {factor:.2f} (slowest / fastest reference workload)"
    ends = sorted({f"{load:.1f}" for load in loads if load in (min(loads), max(loads))}, key=float)
    load = f"load {' to '.join(ends)}" if ends else "load unknown"
    return f"{run.machine.processor}, {run.machine.cores} cores; {speed}; {load}"


def run_state(frames: RunFrames) -> list[str]:
    """Return the warnings, what numbers are relative to if that is not as usual, and drift and load below them."""
    return [*warnings(frames), *basis(frames), steadiness(frames.info)]
