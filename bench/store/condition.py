"""How complete a run is, and how steady its machine was: sentences for the head of every report."""

import math

from ...problems.spelling import either
from .frames import JUDGED, RunFrames
from .records import RunRecord

UNSTEADY = 1.5
"""Drift above which a report warns."""


def drift(run: RunRecord) -> float:
    """Return the longest over the shortest time of the reference workload in a run; NaN where it was timed once."""
    times = [seconds for session in run.sessions for seconds in session.calibration_seconds if seconds > 0.0]
    return max(times) / min(times) if len(times) > 1 else math.nan


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
