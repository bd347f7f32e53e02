"""Condition of a run: warnings about missing cases, excluded times and unsteady machines, for the head of reports."""

import math
from collections import Counter
from collections.abc import Mapping
from itertools import product
from shlex import quote

import numpy as np

from ...problems.contact.solver import Status
from ...problems.representation import first_names
from ..errors import BenchError
from .frames import JUDGED, RunFrames
from .records import Machine, RunRecord

MAX_DRIFT = 1.5
"""Drift above which a report warns."""

MAX_BUSY_CORES = 0.25
"""Number of other cores that other programs may use on average without a warning."""

MAX_MISSING = 3
"""Largest number of missing cases that a warning names."""

EXCLUDED_MARK = "*"
"""Mark of a time whose rounds are all excluded."""

_HARDWARE = {"processor": "processor", "cores": "cores", "logical_cores": "logical cores"}
"""Fields that identify a machine, with their names in sentences."""

_COMPARED = {**_HARDWARE, "memory_bytes": "memory [bytes]", "system": "system", "python": "Python"}
"""Fields of a machine that times depend on."""


def busy_cores(run: RunRecord) -> float:
    """Return the mean number of other busy cores while solves were timed; NaN if unknown."""
    counted = [busy for session in run.sessions if session.core is not None for busy in session.busy_cores]
    return float(np.mean(counted)) if counted else math.nan


def drift(frames: RunFrames) -> float:
    """Return the ratio of the 90 % to the 10 % quantile of the probe times of counted rounds; NaN without them.

    With several machines, the ratio is that of the least steady one.
    """
    sessions, rounds = frames.info.sessions, frames.rounds[frames.rounds["excluded"] == ""]
    hosts_of_rounds = rounds["session"].map(lambda index: sessions[index].machine.host if index < len(sessions) else "")
    spreads = [
        float(probes.quantile(0.9) / probes.quantile(0.1))
        for _, probes in rounds["probe_seconds"].groupby(hosts_of_rounds)
        if probes.quantile(0.1) > 0.0
    ]
    return max(spreads, default=math.nan)


def excluded_points(frames: RunFrames) -> int:
    """Return the number of solved points whose rounds are all excluded."""
    solved = frames.points[frames.points["status"] == Status.SOLVED]
    return int(solved["is_excluded"].eq(True).sum())  # missing values are not equal to True


def differences(before: Machine, now: Machine) -> list[str]:
    """Return how two machines and their software differ, in words; empty if their times are comparable."""
    return [*hardware_differences(before, now, _COMPARED), *software_differences(before, now)]


def hardware_differences(before: Machine, now: Machine, fields: Mapping[str, str] = _HARDWARE) -> list[str]:
    """Return, in words, which of the ``fields`` of two machines differ; ``fields`` maps them to names in sentences."""
    values = ((word, getattr(before, name), getattr(now, name)) for name, word in fields.items())
    return [f"{word} {_short(old)}, now {_short(new)}" for word, old, new in values if old != new]


def software_differences(before: Machine, now: Machine) -> list[str]:
    """Return, in words, which versions, settings and sources on two machines differ."""
    old_values, new_values = (machine.versions | machine.settings for machine in (before, now))
    names = sorted(old_values.keys() | new_values.keys())
    values = [(name, old_values.get(name) or "none", new_values.get(name) or "none") for name in names]
    texts = [f"{name} {old}, now {new}" for name, old, new in values if old != new]
    return [*texts, *hardware_differences(before, now, {"source": "source"})]


def hosts(frames: RunFrames) -> dict[str, int]:
    """Return the number of problems measured on each machine, by the name of the machine."""
    by_problem = machines_by_problem(frames).values()
    return dict(Counter(host for machines in by_problem for host in {machine.host for machine in machines}))


def session_differences(frames: RunFrames) -> list[str]:
    """Return the differences, in words, between the sessions of a run.

    All sessions must have the same versions and source, and those of one problem the same machine.
    """
    machines = [session.machine for session in frames.info.sessions]
    groups, fields = [machines], _COMPARED
    if len(hosts(frames)) > 1:
        groups, fields = list(machines_by_problem(frames).values()), {**_COMPARED, "host": "machine"}
    texts = [
        words for group in groups for machine in group for words in hardware_differences(group[0], machine, fields)
    ]
    texts += [words for machine in machines for words in software_differences(machines[0], machine)]
    return list(dict.fromkeys(texts))


def machines_by_problem(frames: RunFrames) -> dict[str, list[Machine]]:
    """Return the machines on which each problem was measured, one for each session."""
    sessions = frames.info.sessions
    rounds = frames.rounds[frames.rounds["session"] < len(sessions)]
    return {
        str(name): [sessions[number].machine for number in sorted(map(int, session_numbers.unique()))]
        for name, session_numbers in rounds.groupby("problem", sort=False)["session"]
    }


def _short(value: object) -> str:
    """Return a value as text; of a digest, only the first characters."""
    return str(value)[:12] if len(str(value)) == 64 else str(value) or "unknown"


def require_comparable(frames: RunFrames) -> None:
    """Raise ``BenchError`` if a run is a study, or has no measured case."""
    if frames.is_study:
        raise BenchError(f"{frames.folder} is a study, whose points are simulations; name a run over contact problems.")
    if frames.cases.empty:
        raise BenchError(f"{frames.folder} has no measured case; finish it with: {_resume_command(frames)}")


def _resume_command(frames: RunFrames) -> str:
    """Return the command that resumes a run."""
    return f"proxbench run --resume {quote(str(frames.folder))}"


def unfinished(frames: RunFrames) -> list[str]:
    """Return the warnings that cases or shards are missing, or cases measured in part; empty if all are measured.

    A case is missing if it was not reached, if its worker was lost, or if its file was deleted or is damaged.
    """
    return [f"{keyword}: {sentence}" for keyword, sentence in _missing_parts(frames).items()]


def _missing_parts(frames: RunFrames) -> dict[str, str]:
    """Return the warnings that cases or shards are missing, by keyword."""
    sentences = {} if frames.is_finished else {"UNFINISHED": _unfinished_sentence(frames)}
    missing = frames.info.plan.missing_shards
    if missing:
        shards = f"{'shard' if len(missing) == 1 else 'shards'} {first_names(missing, MAX_MISSING)}"
        sentences["INCOMPLETE"] = f"the run was merged without {shards}, whose problems it lacks; merge it with them"
    return sentences


def _unfinished_sentence(frames: RunFrames) -> str:
    """Return how many planned cases are measured, which ones are missing, and the command that resumes the run."""
    plan, n_begun = frames.info.plan, len(frames.cases) - frames.n_finished
    known = set(zip(frames.cases["problem"], frames.cases["solver"], strict=True))
    planned = product(plan.problems, plan.solvers)
    missing = [f"{solver} on {name}" for name, solver in planned if (name, solver) not in known]
    missing_text = f"; missing: {first_names(missing, MAX_MISSING)}" if known and missing else ""
    partial_text = f", {n_begun} more in part" if n_begun else ""
    counts = f"{frames.n_finished} of {frames.n_planned} cases"
    return f"{counts} are measured{partial_text}{missing_text}; resume with: {_resume_command(frames)}"


def warnings(frames: RunFrames) -> list[str]:
    """Return the warnings of a run, such as missing cases or an unsteady machine, each after a keyword in capitals."""
    marked = f", and marked {EXCLUDED_MARK} in the cells that show them"
    return [f"{keyword}: {sentence}" for keyword, sentence in _warnings_by_keyword(frames, marked).items()]


def _warnings_by_keyword(frames: RunFrames, marked: str = "") -> dict[str, str]:
    """Return the warnings of a run by keyword; ``marked`` is a clause about the mark of excluded times."""
    sentences = _missing_parts(frames)
    if len(frames.cases) and not frames.is_study and not frames.cases["n_rows"].any():
        sentences["EMPTY"] = "no problem of this run has a contact, so nothing was solved; choose other problems"
    if excluded := excluded_points(frames):
        counts = f"{excluded} of {int((frames.points['status'] == Status.SOLVED).sum())} times"
        sentences["EXCLUDED"] = (
            f"{counts} were measured while other programs used the core or its speed changed; they are not "
            f"compared{marked}; measure again on a quiet machine"
        )
    if busy_cores(frames.info) > MAX_BUSY_CORES:
        sentences["BUSY"] = (
            f"other programs kept {busy_cores(frames.info):.1f} of the other cores busy while solves were timed; "
            "times are not comparable with those of another run; measure again on a quiet machine"
        )
    if drift(frames) > MAX_DRIFT:
        sentences["UNSTEADY"] = (
            f"the speed of the core changed by a factor of {drift(frames):.2f} during the run; times of "
            "different problems are not comparable; measure again on a quiet machine"
        )
    return sentences | _warnings_of_machines(frames)


def _warnings_of_machines(frames: RunFrames) -> dict[str, str]:
    """Return the warnings about the settings and the differences of the machines of a run, by keyword."""
    sentences: dict[str, str] = {}
    machines = [frames.info.machine, *(session.machine for session in frames.info.sessions)]
    settings = dict.fromkeys(f"{name}={value}" for machine in machines for name, value in machine.settings.items())
    if settings:
        sentences["SETTINGS"] = (
            f"measured with {', '.join(settings)}, which changes times, by a factor that depends on the "
            "solver; unset it and measure again"
        )
    measured = hosts(frames)
    if len(measured) > 1:
        shares = ", ".join(f"{name or 'unknown'}: {count} problems" for name, count in measured.items())
        sentences["MACHINES"] = (
            f"measured on {len(measured)} machines ({shares}), each problem on one of them; times of "
            "different problems are not comparable"
        )
    changes = session_differences(frames)
    if changes:
        sentences["MIXED"] = (
            f"the run was measured in several sessions that differ ({'; '.join(changes)}); times of different "
            "sessions are not comparable; measure again in a single session"
        )
    return sentences


def residual_note(frames: RunFrames) -> list[str]:
    """Return a note that names the kind of the residuals, unless they are the judged ones."""
    if frames.residual == JUDGED:
        return []
    return ["residuals are local: the largest violation of a contact relative to contacts that share a body with it"]


def steadiness(frames: RunFrames) -> str:
    """Return one line about the machine and its steadiness while solves were timed."""
    run, rounds = frames.info, frames.rounds
    machines = [session.machine for session in run.sessions] or [run.machine]
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
    """Return the warnings, the kind of the residuals if it is not the usual one, and the steadiness of the machine."""
    return [*warnings(frames), *residual_note(frames), steadiness(frames)]


def chart_notes(frames: RunFrames) -> list[str]:
    """Return ``run_state`` for a chart: the warnings are sentences without keywords, and without marks of tables."""
    sentences = [sentence[0].upper() + sentence[1:] for sentence in _warnings_by_keyword(frames).values()]
    return [*sentences, *residual_note(frames), steadiness(frames)]
