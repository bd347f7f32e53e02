"""The plan of a study: a scene, methods with their ladders, and limits, validated before the study starts."""

import contextlib
import math
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from typing import Any

from msgspec.structs import replace

from ....problems.contact.solver import Solver
from ....problems.motion.scenes.registry import SCENES, parse_scene
from ....problems.motion.scenes.scene import Scene, StudyDefaults
from ....problems.names import Name
from ...errors import BenchError
from ...plugins.descriptions import solver_spec
from ...plugins.remote_scene import local_or_remote_scene
from ...simulation.starts import DEFAULT_START
from ...store.plans import Limits, PlanRecord, TrajectoryRecord, require_number
from ..plan import Plan
from .defaults import added_methods, default_methods, default_reference
from .methods import Method, make_method
from .problems import MIN_SEEDS

LIMITS = Limits(solve_seconds=600.0, case_seconds=7200.0)
"""Limits of a study: ten minutes for one simulation, and two hours for all simulations of a method."""

NEIGHBOURS = (0.98, 0.99, 1.0, 1.01, 1.02)
"""Factors on steps and tolerances. The error varies erratically with the number of steps, so medians are compared."""

N_SEEDS = 6
"""Number of seeds for a scene of balls."""

ACCURACIES = (1e-2, 1e-3, 1e-4, 1e-6)
"""Errors for which tables give the time."""

POUR_ACCURACIES = (1e-1, 3e-2, 1e-2)
"""Errors for which tables give the time, in scenes of balls over several seeds."""


def make_study_plan(
    scene: str,
    solvers: Iterable[str | Solver] = (),
    *,
    methods: Mapping[str, Sequence[float]] | None = None,
    tolerance: float = 1e-12,
    duration: float | None = None,
    members: Iterable[float] | None = None,
    limits: Limits | None = None,
    start: str = DEFAULT_START,
) -> Plan[Method]:
    """Return the plan of a study of a scene.

    Args:
        scene: name of the scene, with or without options.
        solvers: additional solvers to compare over their tolerances.
        methods: for each method by name, its steps [s] or tolerances; if None, methods suited to the scene.
        tolerance: judged residual that the solvers of ``methods`` must reach, unless the ladder varies it.
        duration: simulated time [s]; the default for the scene if None.
        members: seeds of a scene of balls, otherwise factors on steps and tolerances; if None, defaults.
        limits: limits of each case; those of a solve apply to a simulation.
        start: initial impulses of each solve: "warm", "cold", "warm-then-cold" or "scaled".

    Raises:
        ProxbenchError: for an unknown scene, stepper, solver or option, or a number out of range.
    """
    trajectory, built_scene = _trajectory(scene, duration, members)
    if methods is not None and not isinstance(methods, Mapping):
        raise BenchError(f"`methods` must map names of methods to ladders of numbers, got {methods!r:.60}.")
    if methods is None:
        study_methods = list(default_methods(built_scene, trajectory))
    else:
        study_methods = [make_method(name, values, tolerance) for name, values in methods.items()]
    study_methods += added_methods(built_scene, map(solver_spec, solvers))
    study_methods = [method.with_start(start) for method in study_methods]
    if trajectory.reference is not None:
        trajectory = replace(trajectory, reference=replace(trajectory.reference, start=start))
    for method in study_methods:
        for value in method.record.values:
            stepper = method.setting(value)[0].with_defaults_of(built_scene)
            stepper.check(built_scene, built_scene.start.time, built_scene.start.time + trajectory.duration)
    study_methods = list({method.record.name: method for method in study_methods}.values())
    record = PlanRecord(
        problems=[trajectory.name],
        solvers=[method.record.name for method in study_methods],
        tolerances=list(POUR_ACCURACIES if trajectory.error == "aggregates" else ACCURACIES),
        limits=limits or LIMITS,
        passes=1,
        methods=[method.record for method in study_methods],
        trajectories=[trajectory],
    )
    return Plan(record, (), tuple(study_methods))


def _is_seed(member: float) -> bool:
    return member >= 0.0 and member.is_integer()


def _is_factor(member: float) -> bool:
    return 0.0 < member < math.inf


def _numbers(members: object) -> tuple[float, ...]:
    """Return the members of a study; raise ``BenchError`` unless they are real numbers."""
    numbers: tuple[Any, ...] | None = None
    if isinstance(members, Iterable) and not isinstance(members, Mapping):
        with contextlib.suppress(TypeError):  # an array without axes is not iterable
            numbers = tuple(members)
    if numbers is None or not all(isinstance(one, Real) and not isinstance(one, bool) for one in numbers):
        raise BenchError(f"`members` must be a list of numbers, got {members!r:.60}.")
    return numbers


def _trajectory(scene: str, duration: float | None, members: Iterable[float] | None) -> tuple[TrajectoryRecord, Scene]:
    """Return the record of a trajectory, before its reference is simulated, and the scene."""
    if duration is not None:
        require_number("duration", duration)
    members = None if members is None else _numbers(members)
    plain, options = parse_scene(scene)
    study = SCENES[plain].study if plain in SCENES else StudyDefaults()
    is_cycle = study.is_limit_cycle and duration is None and {**study.options, **options} == study.options
    if is_cycle or not study.is_limit_cycle:
        options = {**study.options, **options}
        duration = study.duration if duration is None else duration
    built_scene = local_or_remote_scene(str(Name(plain, options)))
    is_pour = built_scene.n_balls > 1 and "seed" in built_scene.options and built_scene.exact is None
    if is_pour:
        first = int(options.pop("seed", built_scene.options["seed"]))
        members = range(first, first + N_SEEDS) if members is None else members
        if len(set(members)) < MIN_SEEDS:
            raise BenchError(f"a study over seeds needs at least {MIN_SEEDS} different seeds, got {len(set(members))}.")
    member_values = list(dict.fromkeys(map(float, NEIGHBOURS if members is None else members)))
    valid = _is_seed if is_pour else _is_factor
    invalid = next((member for member in member_values if not valid(member)), None)
    if invalid is not None or not member_values:
        value_text = "none" if invalid is None else invalid
        raise BenchError(f"members must be {'seeds' if is_pour else 'positive factors'}, got {value_text}.")
    seconds = built_scene.duration if duration is None else duration
    if not 0.0 < seconds < math.inf:
        raise BenchError(f"`duration` must be positive and finite, got {seconds:g}; omit it for the default.")
    trajectory = TrajectoryRecord(
        name=str(Name(plain, options)),
        duration=float(seconds),
        members=member_values,
        error="limit cycle" if is_cycle else "aggregates" if is_pour else "end position",
    )
    if is_cycle or built_scene.exact is not None:
        return trajectory, built_scene
    return replace(trajectory, reference=default_reference(built_scene, trajectory).record), built_scene
