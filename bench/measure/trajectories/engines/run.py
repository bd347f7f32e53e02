"""Comparison of physics engines: interleaved runs of all settings, each on one thread in its own process."""

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
"""Number of digits of a source digest that are compared, and shown in error messages."""


class Comparison(msgspec.Struct, frozen=True, kw_only=True):
    """The stored result of ``proxbench engines``.

    Attributes:
        measurements: one per scene, engine and setting, with the shortest times of all rounds.
        versions: version of each engine, by its name.
        rounds: number of runs of each setting; in an interrupted comparison, the number of complete rounds, at least 1.
        load: load average over one minute, before and after the runs. The first value of a resumed comparison is
            the largest value before its runs, including those of the earlier comparison.
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
        """Return the best measurement of an engine in a scene, or None if all runs failed.

        The best run is the fastest of the most accurate ones, whose first error of the scene is negligible, or at most
        ``ERROR_MARGIN`` times the smallest one.
        """
        description = describe(scene)
        first = description.errors[0]
        runs = [run for run in self.measurements if (run.scene, run.engine) == (scene, engine) and not run.failure]
        if not runs:
            return None
        limit = max(description.negligible, ERROR_MARGIN * min(run.errors[first] for run in runs))
        return min((run for run in runs if run.errors[first] <= limit), key=lambda run: run.wall_seconds)


def read_comparison(file: Path) -> Comparison:
    """Read a comparison from a JSON file.

    Raises:
        BenchError: if the file cannot be read, or does not contain a comparison.
    """
    try:
        return msgspec.json.decode(file.read_bytes(), type=Comparison)
    except OSError as error:
        raise BenchError(
            f"cannot read the result {file}: {error.strerror}; name a .json file of proxbench engines."
        ) from None
    except msgspec.MsgspecError as error:
        raise BenchError(
            f"{file} is not a result of proxbench engines: {error_text(error)}; name a .json file that it wrote."
        ) from None


Measure = Callable[[str, str, str], Measurement]
"""``measure(scene, engine, setting)`` measures one run."""


def compare_engines(
    scenes: Sequence[str] = (),
    engines: Sequence[str] = (),
    rounds: int | None = None,
    on_run: Callable[[Measurement], None] = lambda run: None,
    measure: Measure | None = None,
    *,
    earlier: Comparison | None = None,
) -> Comparison:
    """Measure each setting of the engines in each scene.

    Each round runs all settings once, so that a change of the machine's load affects all of them.

    Args:
        scenes: names of scenes; all if empty.
        engines: names of engines; all if empty.
        rounds: number of runs of each setting, of which the shortest times are kept. The default is that of
            ``earlier``, or 1.
        on_run: called with each measurement as soon as its run has ended.
        measure: measures one run; by default in a subprocess.
        earlier: a comparison whose successful runs are kept and not repeated.

    Returns:
        The comparison; after Ctrl-C, a comparison of the finished runs.

    Raises:
        BenchError: if a name is unknown, or an engine is not installed or has an untested version. Also if ``earlier``
            has another version of an engine, another source of Proxbench, another processor or other ``rounds``.
    """
    for scene in scenes:
        if scene not in SCENES:
            raise BenchError(f"there is no engine scene {scene!r}{suggestion(scene, SCENES)}")
    versions = {engine: version_of(engine) for engine in engines or ENGINES}
    machine, load_before, measurements = msgspec.to_builtins(this_machine()), os.getloadavg()[0], {}
    if earlier is not None:
        _require_comparable(earlier, versions, machine)
        if rounds not in (None, earlier.rounds):
            raise BenchError(f"the earlier runs have {earlier.rounds} rounds, not {rounds}; omit `rounds`.")
        measurements = {(run.scene, run.engine, run.setting): run for run in earlier.measurements if not run.failure}
        versions, rounds = earlier.versions | versions, earlier.rounds
        load_before = max(load_before, *earlier.load)
    pending = [key for key in _run_keys(scenes or SCENES, engines or ENGINES) if key not in measurements]
    n_finished, rounds, is_interrupted = 0, rounds or 1, False
    try:
        for _ in range(rounds):
            for key in pending:
                run = (measure or _measure_in_subprocess)(*key)
                measurements[key] = _with_shorter_times(measurements.get(key), run)
                on_run(run)
            n_finished += 1
    except KeyboardInterrupt:
        is_interrupted, rounds = True, max(1, n_finished)
    return Comparison(
        measurements=tuple(measurements.values()),
        versions=versions,
        rounds=rounds,
        load=(load_before, os.getloadavg()[0]),
        machine=machine,
        is_interrupted=is_interrupted,
    )


def _require_comparable(earlier: Comparison, versions: dict[str, str], machine: dict[str, Any]) -> None:
    """Raise ``BenchError`` if new runs are not comparable with earlier ones."""
    pairs = [(engine, version, earlier.versions.get(engine, version)) for engine, version in versions.items()]
    pairs.append(("processor", machine["processor"], earlier.machine["processor"]))
    source, earlier_source = (str(record.get("source"))[:DIGEST_LENGTH] for record in (machine, earlier.machine))
    pairs.append(("the source of Proxbench with the digest", source, earlier_source))
    for name, new, old in pairs:
        if new != old:
            raise BenchError(f"the earlier runs used {name} {old}, not {new}; measure all of them again.")


def _run_keys(scenes: Iterable[str], engines: Iterable[str]) -> Iterable[tuple[str, str, str]]:
    """Yield (scene, engine, setting) of each run, alternating between the engines of a scene."""
    for scene in scenes:
        for keys in itertools.zip_longest(
            *([(engine, setting.name) for setting in ENGINES[engine].settings] for engine in engines)
        ):
            yield from ((scene, *key) for key in keys if key is not None)


def _with_shorter_times(previous: Measurement | None, latest: Measurement) -> Measurement:
    """Return the latest measurement with the shorter times of both; if one failed, return the failed one."""
    if previous is None or latest.failure:
        return latest
    if previous.failure:
        return previous
    names = ("wall_seconds", "processor_seconds")
    times = {name: min(getattr(previous, name), getattr(latest, name)) for name in names}
    return msgspec.structs.replace(latest, **times)


def _measure_in_subprocess(scene: str, engine: str, setting: str) -> Measurement:
    """Measure one run in a subprocess; any failure becomes the ``failure`` of the measurement."""
    program = [sys.executable, "-m", f"{__package__}.measurement", scene, engine, setting]
    environment = os.environ | ONE_THREAD
    try:
        process = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=RUN_SECONDS)
    except subprocess.TimeoutExpired:
        return _failed_measurement(scene, engine, setting, f"took longer than {RUN_SECONDS:.0f} s")
    if process.returncode:
        lines = process.stderr.strip().splitlines() or [f"exit code {process.returncode}"]
        return _failed_measurement(scene, engine, setting, lines[-1])
    return msgspec.json.decode(process.stdout.splitlines()[-1], type=Measurement)  # libraries may print before it


def _failed_measurement(scene: str, engine: str, setting: str, failure: str) -> Measurement:
    """Return the measurement of a run that failed for the reason ``failure``."""
    factor = next(known.step_factor for known in ENGINES[engine].settings if known.name == setting)
    time_step = describe(scene).step * factor
    return Measurement(scene=scene, engine=engine, setting=setting, time_step=time_step, failure=failure)
