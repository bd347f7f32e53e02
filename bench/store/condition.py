"""How complete a run is, and how steady its machine was: sentences for the head of every report."""

import math
from collections.abc import Mapping

import numpy as np

from ...problems.contact.solver import Status
from ..errors import BenchError
from .frames import JUDGED, RunFrames
from .records import Machine, RunRecord

UNSTEADY = 1.5
"""Spread of the probes of a run above which a report warns."""

BUSY = 0.25
"""Number of other cores that other programs may use on average without a warning."""

EXCLUDED_MARK = "*"
"""What marks a time all of whose rounds are excluded."""

_HARDWARE = {"processor": "processor", "cores": "cores", "logical_cores": "logical cores"}
"""Fields of a machine by which it is another one, with their names in sentences."""

_COMPARED = {**_HARDWARE, "memory_bytes": "memory [bytes]", "system": "system", "python": "Python"}
"""Fields of a machine that times depend on."""


def busy_cores(run: RunRecord) -> float:
    """Return how many other cores were busy on average while solves were timed; NaN where that was not counted."""
    counted = [busy for session in run.sessions if session.core is not None for busy in session.busy_cores]
    return float(np.mean(counted)) if counted else math.nan


def drift(frames: RunFrames) -> float:
    """Return the 90 % over the 10 % quantile of the probes around the rounds of a run that count; NaN without any.

    Of a run on several machines it is that of the least steady one.
    """
    sessions, rounds = frames.info.sessions, frames.rounds[frames.rounds["excluded"] == ""]
    hosts_of_rounds = rounds["session"].map(lambda one: sessions[one].host if one < len(sessions) else "")
    spreads = [
        float(probes.quantile(0.9) / probes.quantile(0.1))
        for _, probes in rounds["probe_seconds"].groupby(hosts_of_rounds)
        if probes.quantile(0.1) > 0.0
    ]
    return max(spreads, default=math.nan)


def excluded_points(frames: RunFrames) -> int:
    """Return the number of points that end solved and all of whose rounds are excluded."""
    solved = frames.points[frames.points["status"] == Status.SOLVED]
    return int(solved["is_excluded"].eq(True).sum())  # missing values are not equal to True


def differences(before: Machine, now: Machine) -> list[str]:
    """Return in words what two machines, or the versions and sources on them, differ in; nothing if times compare."""
    return [*other_hardware(before, now, _COMPARED), *other_software(before, now)]


def other_hardware(before: Machine, now: Machine, fields: Mapping[str, str] = _HARDWARE) -> list[str]:
    """Return in words by which of some fields, those of the hardware if none are given, a machine is another one."""
    return [
        f"{word} {_short(getattr(before, name))}, now {_short(getattr(now, name))}"
        for name, word in fields.items()
        if getattr(before, name) != getattr(now, name)
    ]


def other_software(before: Machine, now: Machine) -> list[str]:
    """Return in words what versions and sources on two machines differ in."""
    names = sorted(set(before.versions) | set(now.versions))
    versions = ((name, before.versions.get(name, "none"), now.versions.get(name, "none")) for name in names)
    found = [f"{name} {old or 'none'}, now {new or 'none'}" for name, old, new in versions if old != new]
    if before.source != now.source:
        found.append(f"source {_short(before.source)}, now {_short(now.source)}")
    return found


def hosts(frames: RunFrames) -> dict[str, int]:
    """Return how many problems of a run were measured on each machine, by its name."""
    names = [session.host for session in frames.info.sessions]
    found = [{names[index] for index in indices} for indices in _sessions_by_problem(frames).values()]
    return {name: sum(name in one for one in found) for name in dict.fromkeys(names)}


def mixtures(frames: RunFrames) -> list[str]:
    """Return in words what sessions of a run differ in though their times are compared.

    All must have the same versions and source, and those that measured one problem the same machine.
    """
    machines = _machines(frames)
    is_one = len(hosts(frames)) <= 1
    groups = [machines] if is_one else list(machines_by_problem(frames).values())
    found = [said for group in groups for machine in group for said in other_hardware(group[0], machine, _COMPARED)]
    found += [
        f"machine {group[0].host}, now {machine.host}"
        for group in groups
        for machine in group
        if not is_one and machine.host != group[0].host
    ]
    found += [said for machine in machines for said in other_software(machines[0], machine)]
    return list(dict.fromkeys(found))


def machines_by_problem(frames: RunFrames) -> dict[str, list[Machine]]:
    """Return the machines on which each problem was measured, as far as the run has them."""
    machines = _machines(frames)
    return {name: [machines[index] for index in used] for name, used in _sessions_by_problem(frames).items()}


def _machines(frames: RunFrames) -> list[Machine]:
    """Return the machine of each session."""
    return [session.machine or frames.info.machine for session in frames.info.sessions]


def _sessions_by_problem(frames: RunFrames) -> dict[str, list[int]]:
    """Return the sessions in which each problem was measured, as far as the run has them."""
    known = frames.rounds[frames.rounds["session"] < len(frames.info.sessions)]
    by_problem = known.groupby("problem", sort=False)["session"]
    return {str(name): sorted(set(map(int, sessions))) for name, sessions in by_problem}


def _short(value: object) -> str:
    return str(value)[:12] if len(str(value)) == 64 else str(value) or "unknown"


def require_comparable(frames: RunFrames) -> None:
    """Raise a BenchError if a run is a study, or has no measured case."""
    if frames.is_study:
        raise BenchError(f"{frames.folder} is a study, whose points are simulations; name a run over contact problems.")
    if frames.cases.empty:
        raise BenchError(f"{frames.folder} has no measured case; finish it with: {_resuming(frames)}")


def _resuming(frames: RunFrames) -> str:
    return f"proxbench run --resume {frames.folder}"


def warnings(frames: RunFrames) -> list[str]:
    """Return what a reader must know before the numbers: that cases are missing, that the machine was not steady."""
    found = []
    if not frames.is_finished:
        begun = len(frames.cases) - frames.n_finished
        partly = f", {begun} more in part" if begun else ""
        counts = f"{frames.n_finished} of {frames.n_planned} cases"
        found.append(f"UNFINISHED: {counts} are measured{partly}; resume with: {_resuming(frames)}")
    if len(frames.cases) and not frames.is_study and not frames.cases["n_rows"].any():
        found.append("EMPTY: no problem of this run has a contact, so nothing was solved; choose other problems")
    if excluded := excluded_points(frames):
        counts = f"{excluded} of {int((frames.points['status'] == Status.SOLVED).sum())} times"
        found.append(
            f"EXCLUDED: {counts} were measured while something else used the core; they are marked {EXCLUDED_MARK} and "
            "take part in no comparison; measure again on a quiet machine"
        )
    if busy_cores(frames.info) > BUSY:
        found.append(
            f"BUSY: other programs used {busy_cores(frames.info):.1f} other cores on average while solves were timed; "
            "times do not compare with those of another run; measure again on a quiet machine"
        )
    if drift(frames) > UNSTEADY:
        found.append(
            f"UNSTEADY: the speed of the core changed by a factor of {drift(frames):.2f} during the run; times of "
            "different problems do not compare; measure again on a quiet machine"
        )
    measured = hosts(frames)
    if len(measured) > 1:
        shares = ", ".join(f"{name or 'unknown'}: {count} problems" for name, count in measured.items())
        found.append(
            f"MACHINES: measured on {len(measured)} machines ({shares}), each problem on one of them; times of "
            "different problems do not compare"
        )
    mixed = mixtures(frames)
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


def steadiness(frames: RunFrames) -> str:
    """Return in one line what the machine is, and how steady it was while solves were timed."""
    run, rounds = frames.info, frames.rounds
    machines = [session.machine for session in run.sessions if session.machine is not None] or [run.machine]
    names = dict.fromkeys(f"{machine.processor}, {machine.cores} cores" for machine in machines)
    parts = [" and ".join(names)]
    if len(rounds):
        parts.append(f"{100.0 * (rounds['excluded'] != '').mean():.0f} % of {len(rounds)} rounds excluded")
    if not math.isnan(drift(frames)):
        parts.append(f"probes differ by a factor of {drift(frames):.2f}")
    if not math.isnan(busy_cores(run)):
        parts.append(f"other programs used {busy_cores(run):.1f} cores")
    return "; ".join(parts)


def run_state(frames: RunFrames) -> list[str]:
    """Return the warnings, what numbers are relative to if that is not as usual, and how steady the machine was."""
    return [*warnings(frames), *basis(frames), steadiness(frames)]
