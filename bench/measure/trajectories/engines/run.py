"""Interleaved runs over scenes, engines and settings, each in its own process, on one thread."""

import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from .....problems.errors import error_text, suggestion
from ....errors import BenchError
from ....isolation.fork_server import ONE_THREAD
from ...machine import this_machine
from .description import ERROR_MARGIN
from .engine import ENGINES, version_of
from .measurement import Measurement
from .scenes import SCENES, describe

RUN_SECONDS = 600.0
"""Time limit of one run [s]."""

DIGEST_LENGTH = 12
"""Number of digits of a digest that distinguish sources."""


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """The stored result of ``proxbench engines``.

    Attributes:
        measurements: a run of each setting, with its shortest times.
        versions: versions of the engines.
        rounds: least number of runs of each setting.
        load: load of the machine over one minute, before and after; the largest one of earlier runs counts as before.
        machine: the machine, as in the record of a run.
        is_interrupted: whether Ctrl-C ended the comparison before its last run.
    """

    measurements: tuple[Measurement, ...]
    versions: dict[str, str]
    rounds: int
    load: tuple[float, float]
    machine: dict[str, Any]
    is_interrupted: bool = False

    def best(self, scene: str, engine: str) -> Measurement | None:
        """Return the best setting of an engine: the fastest among the most accurate by the first error of the scene."""
        description = describe(scene)
        first = description.errors[0]
        runs = [run for run in self.measurements if (run.scene, run.engine) == (scene, engine) and not run.failure]
        if not runs:
            return None
        limit = max(description.negligible, ERROR_MARGIN * min(run.errors[first] for run in runs))
        return min((run for run in runs if run.errors[first] <= limit), key=lambda run: run.wall_seconds)


def read_comparison(file: Path) -> Comparison:
    """Return a comparison that was written as JSON.

    Raises:
        BenchError: if the file cannot be read as one.
    """
    try:
        return msgspec.json.decode(file.read_bytes(), type=Comparison)
    except (OSError, msgspec.MsgspecError) as error:
        raise BenchError(f"cannot read {file} as a result of proxbench engines: {error_text(error)}.") from None


Measure = Callable[[str, str, str], Measurement]


def compare_engines(
    scenes: Sequence[str] = (),
    engines: Sequence[str] = (),
    rounds: int | None = None,
    on_run: Callable[[Measurement], None] = lambda run: None,
    measure: Measure | None = None,
    earlier: Comparison | None = None,
) -> Comparison:
    """Measure each setting of the engines on the scenes.

    Each round runs all settings once, so that a change of the machine's load affects all of them. Ctrl-C ends the
    comparison, and the finished runs are returned.

    Args:
        scenes: names of scenes; all if empty.
        engines: names of engines; all if empty.
        rounds: how often each setting runs; its shortest times count. The default is that of ``earlier``, or 1.
        on_run: called after each run.
        measure: measures one run, given scene, engine and setting; by default in its own process.
        earlier: a comparison whose successful runs are kept and not repeated.

    Raises:
        BenchError: if a name is unknown, an engine is not installed or of an untried version, or ``earlier`` is of
            another version of an engine, another source of Proxbench, another processor or other ``rounds``.
    """
    for scene in scenes:
        if scene not in SCENES:
            raise BenchError(f"unknown scene {scene!r} of engines{suggestion(scene, SCENES)}")
    versions = {engine: version_of(engine) for engine in engines or ENGINES}
    machine, before, found = msgspec.to_builtins(this_machine()), os.getloadavg()[0], {}
    if earlier is not None:
        _require_same(earlier, versions, machine)
        if rounds not in (None, earlier.rounds):
            raise BenchError(f"the earlier runs have {earlier.rounds} rounds, not {rounds}; leave the number out.")
        found = {(run.scene, run.engine, run.setting): run for run in earlier.measurements if not run.failure}
        versions, rounds, before = earlier.versions | versions, earlier.rounds, max(before, *earlier.load)
    left = [key for key in _settings(scenes or SCENES, engines or ENGINES) if key not in found]
    finished, rounds, is_interrupted = 0, rounds or 1, False
    try:
        for _ in range(rounds):
            for key in left:
                run = (measure or _in_own_process)(*key)
                found[key] = _faster(found.get(key), run)
                on_run(run)
            finished += 1
    except KeyboardInterrupt:
        is_interrupted, rounds = True, max(1, finished)
    return Comparison(
        measurements=tuple(found.values()),
        versions=versions,
        rounds=rounds,
        load=(before, os.getloadavg()[0]),
        machine=machine,
        is_interrupted=is_interrupted,
    )


def _require_same(earlier: Comparison, versions: dict[str, str], machine: dict[str, Any]) -> None:
    """Raise ``BenchError`` if new runs are not comparable with earlier ones."""
    pairs = [(engine, version, earlier.versions.get(engine, version)) for engine, version in versions.items()]
    pairs.append(("processor", machine["processor"], earlier.machine["processor"]))
    here, there = (str(one.get("source"))[:DIGEST_LENGTH] for one in (machine, earlier.machine))
    pairs.append(("the source of Proxbench with the digest", here, there))
    for name, here, there in pairs:
        if here != there:
            raise BenchError(f"the earlier runs used {name} {there}, not {here}; measure all of them again.")


def _settings(scenes: Iterable[str], engines: Iterable[str]) -> Iterable[tuple[str, str, str]]:
    """Yield scene, engine and setting, the engines in turn."""
    for scene in scenes:
        for settings in itertools.zip_longest(*([(e, s.name) for s in ENGINES[e].settings] for e in engines)):
            yield from ((scene, *setting) for setting in settings if setting is not None)


def _faster(one: Measurement | None, other: Measurement) -> Measurement:
    """Return a run with the shorter times of two, or the failed one."""
    if one is None or other.failure:
        return other
    if one.failure:
        return one
    times = {name: min(getattr(one, name), getattr(other, name)) for name in ("wall_seconds", "processor_seconds")}
    return msgspec.structs.replace(other, **times)


def _in_own_process(scene: str, engine: str, setting: str) -> Measurement:
    """Measure one run in its own process."""
    program = [sys.executable, "-m", f"{__package__}.measurement", scene, engine, setting]
    environment = os.environ | ONE_THREAD
    try:
        ended = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=RUN_SECONDS)
    except subprocess.TimeoutExpired:
        return _failed(scene, engine, setting, f"took longer than {RUN_SECONDS:.0f} s")
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"]
        return _failed(scene, engine, setting, lines[-1])
    return msgspec.json.decode(ended.stdout.splitlines()[-1], type=Measurement)  # libraries print before it


def _failed(scene: str, engine: str, setting: str, failure: str) -> Measurement:
    factor = next(one.step_factor for one in ENGINES[engine].settings if one.name == setting)
    time_step = describe(scene).step * factor
    return Measurement(scene=scene, engine=engine, setting=setting, time_step=time_step, failure=failure)
