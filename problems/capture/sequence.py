"""Simulation with MuJoCo that writes every n-th step as a problem file of one suite."""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ProblemError, suggestion
from ..exchange.files.problem_file import write_whole
from ..exchange.folder import DESCRIPTION
from ..exchange.sequences import BEFORE, STEP
from ..representation import counted
from .contact_keys import NO_ANCHORS, distinct_keys, pair_of
from .files import save_step
from .mujoco_import import mujoco, without_log
from .rows import RefusedRow
from .step import VELOCITY_ERROR, CapturedStep, EmptyStepError, captured_step, take_step

HEADING = "# the steps that proxbench capture wrote"
"""First line of the description of a folder."""

STEP_DIGITS = 6
"""Number of digits of the step number in a file name."""

CONTROL_SECONDS = 0.02
"""Time for which random controls stay constant [s]."""


@dataclass(frozen=True)
class CaptureOptions:
    """Options of a simulation and its capture.

    Attributes:
        duration: simulated time [s].
        every: number of steps from one captured step to the next.
        keyframe: name or number of the model's keyframe to start from; the model's initial state if empty.
        seed: seed of random controls; ``None`` leaves the controls unchanged.

    Raises:
        ProblemError: if the duration or the number of steps is not positive, or the seed is negative.
    """

    duration: float = 1.0
    every: int = 10
    keyframe: str = ""
    seed: int | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.duration < math.inf:
            raise ProblemError(f"`duration` must be positive and finite, got {self.duration:g}.")
        if self.every < 1:
            raise ProblemError(f"`every` must be at least 1, got {self.every}.")
        if self.seed is not None and self.seed < 0:
            raise ProblemError(f"`seed` must not be negative, got {self.seed}.")


@dataclass
class CaptureSummary:
    """The result of a capture.

    Attributes:
        files: the files written, in order.
        empty: number of examined steps without a supported constraint row.
        laws: number of laws of the largest problem.
        engine_rows: number of engine rows in all examined steps.
        velocity_error: largest error of the velocity after a captured step, relative to its largest term.
        refused_rows: the refused rows by step number, for the examined steps that have any.
        error: why the capture ended early; empty if it did not.
    """

    files: list[Path] = field(default_factory=list)
    empty: int = 0
    laws: int = 0
    engine_rows: int = 0
    velocity_error: float = 0.0
    refused_rows: dict[int, tuple[RefusedRow, ...]] = field(default_factory=dict)
    error: str = ""

    @property
    def refused(self) -> Counter[str]:
        """Number of refused rows, by reason."""
        return Counter(row.reason for rows in self.refused_rows.values() for row in rows)

    def add(self, number: int, step: CapturedStep | EmptyStepError) -> None:
        """Count an examined step and its rows."""
        if step.refused:
            self.refused_rows[number] = step.refused
        if isinstance(step, EmptyStepError):
            self.empty += 1
            self.engine_rows += len(step.refused)
        else:
            self.engine_rows += len(step.forces)
            self.laws = max(self.laws, step.problem.laws.n_laws)
            self.velocity_error = max(self.velocity_error, float(step.problem.provenance[VELOCITY_ERROR]))


@without_log()
def capture(
    file: Path,
    output: Path,
    options: CaptureOptions,
    *,
    force: bool = False,
    on_step: Callable[[CapturedStep], None] = lambda step: None,
) -> CaptureSummary:
    """Simulate a model and write the captured steps to the folder ``output``, which becomes a suite.

    Args:
        file: an MJCF or URDF file, or a compiled model (.mjb).
        output: the folder of the problem files; created if it does not exist.
        options: options of the simulation and the capture.
        force: replace the existing steps of this model in the folder.
        on_step: called with each captured step after it is written.

    Returns:
        A summary of the written files. If a step fails, the summary covers the steps before it and contains the error.

    Raises:
        ProblemError: if the folder has steps of this model and ``force`` is False, the model or its keyframe cannot be
            read, the first step cannot be captured, or no step has a supported row.
    """
    model, old_files = _read_model(file), _captured_files(output, file.stem)
    if old_files and not force:
        raise ProblemError(
            f"{output} already contains {counted(len(old_files), 'step')} of {file.stem}; choose another `output`, or "
            f"replace them with `force=True`."
        )
    data = _initial_data(model, file, options.keyframe)
    summary = CaptureSummary()
    try:
        for index, step in enumerate(captured_steps(model, data, options, file.stem)):
            summary.add(index * options.every, step)
            if isinstance(step, EmptyStepError):
                continue
            if not summary.files:
                for old_file in old_files:
                    old_file.unlink()
                _describe(output, file.stem)
            path = output / f"{step.problem.name}.npz"
            save_step(step, path)
            summary.files.append(path)
            on_step(step)
    except ProblemError as error:
        if not summary.files:
            raise
        summary.error = str(error)
    if not summary.files:
        raise ProblemError(_empty_reason(file, summary, options))
    return summary


def _empty_reason(file: Path, summary: CaptureSummary, options: CaptureOptions) -> str:
    """Return why no step was captured."""
    examined = f"in the {counted(summary.empty, 'step')} examined during {options.duration:g} s"
    if summary.refused_rows:
        row = next(iter(summary.refused_rows.values()))[0]
        return f"{file} has no supported constraint {examined}: {row.name} is refused because {row.reason}."
    return (
        f"{file} has no contact and no other constraint {examined}; choose a longer `duration`, a smaller `every`, "
        f"or a `keyframe` in contact."
    )


def captured_steps(
    model: Any, data: Any, options: CaptureOptions, stem: str
) -> Iterator[CapturedStep | EmptyStepError]:
    """Simulate from the state of ``data``; yield each captured step, or the error of a step without supported rows.

    Raises:
        ProblemError: if MuJoCo fails, or a step cannot be captured.
    """
    rng = None if options.seed is None else np.random.default_rng(options.seed)
    n_steps = max(1, round(options.duration / model.opt.timestep))
    steps_per_control = max(1, round(CONTROL_SECONDS / model.opt.timestep))
    previous: CapturedStep | None = None
    for number in range(n_steps):
        if rng is not None and number % steps_per_control == 0:
            data.ctrl[:] = _random_controls(model, rng)
        if number % options.every == 0:
            try:
                previous = _named(captured_step(model, data), previous, stem, number)
                yield previous
            except EmptyStepError as error:
                yield error
        take_step(model, data)


def _named(step: CapturedStep, previous: CapturedStep | None, stem: str, number: int) -> CapturedStep:
    """Return a step with its name and place in the sequence, and keys that continue those of the previous one."""
    previous_keys = ((), NO_ANCHORS) if previous is None else (previous.keys, previous.anchors)
    keys = distinct_keys([pair_of(key) for key in step.keys], step.anchors, *previous_keys)
    name = f"{stem}-{number:0{STEP_DIGITS}d}"
    is_adjacent = previous is not None and previous.problem.provenance[STEP] == number - 1
    link = {BEFORE: previous.problem.name} if previous is not None and is_adjacent else {}
    problem = step.problem.keyed(keys).renamed(name, family=stem, sequence=stem, **{STEP: number}, **link)
    return replace(step, problem=problem)


def _random_controls(model: Any, rng: np.random.Generator) -> Any:
    """Return controls drawn uniformly from their ranges, or from [-1, 1] for actuators without limits, shape (nu,)."""
    limited = model.actuator_ctrllimited.astype(bool)
    low = np.where(limited, model.actuator_ctrlrange[:, 0], -1.0)
    high = np.where(limited, model.actuator_ctrlrange[:, 1], 1.0)
    return rng.uniform(low, high)


def _read_model(file: Path) -> Any:
    module = mujoco()
    if not file.is_file():
        raise ProblemError(f"there is no model {file}; name an MJCF or URDF file.")
    read = module.MjModel.from_binary_path if file.suffix == ".mjb" else module.MjModel.from_xml_path
    try:
        return read(str(file))
    except (ValueError, module.FatalError) as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise ProblemError(f"MuJoCo cannot read {file}: {reason}; correct the model.") from None


def _initial_data(model: Any, file: Path, keyframe: str) -> Any:
    module = mujoco()
    data = module.MjData(model)
    if keyframe:
        names = [module.mj_id2name(model, module.mjtObj.mjOBJ_KEY, index) or str(index) for index in range(model.nkey)]
        if keyframe not in names and not (keyframe.isdecimal() and int(keyframe) < model.nkey):
            raise ProblemError(f"{file} has no keyframe {keyframe!r}{suggestion(keyframe, names)}")
        index = names.index(keyframe) if keyframe in names else int(keyframe)
        module.mj_resetDataKeyframe(model, data, index)
    return data


def _captured_files(output: Path, stem: str = "") -> list[Path]:
    """Return the files of earlier captures of a model, or of all models if ``stem`` is empty."""
    return sorted(output.glob(f"{escape(stem) or '*'}-{'[0-9]' * STEP_DIGITS}.npz"))


def _describe(output: Path, stem: str) -> None:
    """Make the folder a suite with a family per captured model; do not replace a description without ``HEADING``."""
    file = output / DESCRIPTION
    if file.exists() and not file.read_text(encoding="utf-8", errors="replace").startswith(HEADING):
        return
    stems = {path.stem[: -STEP_DIGITS - 1] for path in _captured_files(output)} | {stem}
    lines = [HEADING, f"name = {json.dumps(output.resolve().name)}", "[groups]"]
    lines += [f"{json.dumps(name)} = [{json.dumps(f'{escape(name)}-*')}]" for name in sorted(stems, reverse=True)]
    write_whole(file, ("\n".join(lines) + "\n").encode())
