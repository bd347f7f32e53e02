"""The stored row of an accepted step; its columns have the names of the fields of ``StepRow``."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import local_residual
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Status
from ...problems.motion.bodies.system import ActiveContacts
from ...problems.motion.scenes.scene import Scene
from ...problems.motion.state import State
from ...problems.motion.stepping.step import AcceptedStep, Step
from ..errors import BenchError

NO_CONTACT = "no contact"
"""Status of a step without an active contact, in which nothing is solved."""

STATUSES = (NO_CONTACT, *(status.value for status in Status))
"""Texts by the stored status of a step."""


def _column(kind: str) -> Any:
    """Return a dataclass field that is stored as a column of the NumPy type ``kind``."""
    return field(metadata={"type": kind})


@dataclass(frozen=True)
class StepRow:
    """One accepted step.

    Attributes:
        time: time at the end of the step [s].
        length: length of the step [s].
        error: estimated relative error, 0 without an estimate.
        solves: number of one-step inclusions, with or without contacts, including those of rejected attempts.
        rejected: number of rejected attempts before the step.
        contacts: number of active contacts at the end of the step.
        iterations: iterations of the solver in all these inclusions; 0 for a stepper that does not count them.
        residual: the largest judged residual of the one-step solves that give the result, without those of rejected
            attempts and of shorter sequences over the same interval.
        local_residual: the largest local residual of these solves.
        status: status of the solve with the largest judged residual, as an index into the statuses of the simulation.
        kinetic_energy: kinetic energy at the end of the step [J].
        potential_energy: potential energy at the end of the step [J], NaN if unknown.
        penetration: largest penetration at the beginning of one-step solves, relative to the length of the scene. It is
            extrapolated linearly from the midpoint, which exaggerates it if bodies pass each other fast.
        impact_depth: largest penetration at their midpoints, where contacts are detected, relative to this length.
        overlap: largest penetration at the ends of one-step solves whose projection of positions did not reach its
            tolerance, relative to this length; 0 if there are none, NaN in files of an older format.
        seconds: wall time of all attempts [s], without the time in which numba compiles or loads kernels, except in
            scenes and solvers of plugins.
        observed: values of the observables of the scene, in order, each with its own column.
    """

    time: float = _column("<f8")
    length: float = _column("<f8")
    error: float = _column("<f8")
    solves: int = _column("<i4")
    rejected: int = _column("<i4")
    contacts: int = _column("<i4")
    iterations: int = _column("<i4")
    residual: float = _column("<f8")
    local_residual: float = _column("<f8")
    status: int = _column("u1")
    kinetic_energy: float = _column("<f8")
    potential_energy: float = _column("<f8")
    penetration: float = _column("<f8")
    impact_depth: float = _column("<f8")
    overlap: float = _column("<f8")
    seconds: float = _column("<f8")
    observed: tuple[float, ...] = ()

    @property
    def values(self) -> tuple[float, ...]:
        """The values in the order of ``step_columns``."""
        return (*map(self.__dict__.__getitem__, _OWN_COLUMNS), *self.observed)


_OWN_COLUMNS = {column.name: column.metadata["type"] for column in fields(StepRow) if "type" in column.metadata}
"""Types of the columns of every scene, by name."""


def step_columns(scene: Scene) -> np.dtype[np.void]:
    """Return the type of the rows of a scene: the columns of every scene, and its observables.

    Raises:
        BenchError: if two columns have the same name, or an observable has no name.
    """
    names = [observable.name for observable in scene.observables]
    for name in names:
        if name in _OWN_COLUMNS or names.count(name) > 1 or not name:
            raise BenchError(
                f"the scene {scene.name!r} has an observable {name!r}, but names of observables must not be empty, "
                "occur twice, or be the name of another column; rename it."
            )
    return np.dtype(
        [
            *_OWN_COLUMNS.items(),
            *((observable.name, "<i4" if observable.is_count else "<f8") for observable in scene.observables),
        ]
    )


@dataclass(frozen=True)
class SceneValues:
    """Energies and observables of a state.

    Attributes:
        kinetic_energy: kinetic energy [J].
        potential_energy: potential energy [J], NaN if unknown.
        observed: values of the observables of the scene, in order.
    """

    kinetic_energy: float
    potential_energy: float
    observed: tuple[float, ...]


def scene_values(scene: Scene, state: State) -> SceneValues:
    """Return the energies and observables of a state of ``scene``."""
    potential = math.nan if scene.potential_energy is None else scene.potential_energy(state.position)
    observed = tuple(float(observable.compute(state)) for observable in scene.observables)
    return SceneValues(scene.kinetic_energy(state.velocity), potential, observed)


def step_row(scene: Scene, accepted: AcceptedStep, values: SceneValues, statuses: Sequence[str]) -> StepRow:
    """Judge one accepted step.

    Args:
        scene: the scene.
        accepted: the step.
        values: energies and observables at the end of the step.
        statuses: texts by the stored status.
    """
    state = accepted.end
    solved = [step for step, _ in accepted.substeps]
    residuals = [judged_residual(step) for step in solved]
    worst = residuals.index(max(residuals)) if residuals else None
    status = None if worst is None else solved[worst].status
    contacts = solved[-1].contacts if solved else None
    solves = list(_solves(accepted))
    depth, impact = _depths(solves)
    return StepRow(
        time=state.time,
        length=state.time - accepted.begin.time,
        error=accepted.error,
        solves=accepted.solves,
        rejected=accepted.rejected,
        contacts=0 if contacts is None else contacts.n_contacts,
        iterations=accepted.iterations,
        residual=max(residuals, default=0.0),
        local_residual=max(map(_local_residual, solves), default=0.0),
        status=statuses.index(NO_CONTACT if status is None else status),
        kinetic_energy=values.kinetic_energy,
        potential_energy=values.potential_energy,
        penetration=depth / scene.length,
        impact_depth=impact / scene.length,
        overlap=max((step.overlap for step in solved), default=0.0) / scene.length,
        seconds=accepted.seconds,
        observed=values.observed,
    )


@dataclass(frozen=True, eq=False)
class _Solve:
    """A one-step solve with contacts.

    Attributes:
        problem: the one-step problem.
        contacts: the active contacts.
        impulses: Λ [N s], shape (n_rows,).
        length: Δt [s].
        approach: relative velocity Wᵀu_B at the beginning of the solve [m/s], shape (n_rows,).
    """

    problem: ContactProblem
    contacts: ActiveContacts
    impulses: FloatArray
    length: float
    approach: FloatArray


def _solves(accepted: AcceptedStep) -> Iterator[_Solve]:
    """Yield the one-step solves with contacts."""
    velocity = accepted.begin.velocity
    for step, length in accepted.substeps:
        if step.contacts is not None and step.problem is not None:
            approach = step.contacts.transposed_times(velocity)
            yield _Solve(step.problem, step.contacts, step.impulses, length, approach)
        velocity = step.state.velocity


def _depths(solves: Sequence[_Solve]) -> tuple[float, float]:
    """Return the largest penetrations [m] at the beginning of one-step solves, and at their midpoints.

    The gap at the midpoint follows from the velocity at the beginning, g_M = g_B + γ_B Δt/2.
    """
    depth, impact = 0.0, 0.0
    for solve in solves:
        contacts, normal = solve.contacts, solve.contacts.normals(solve.approach)
        gap = contacts.gap if contacts.row_counts is None else contacts.gap[contacts.is_contact]
        depth = max(depth, -float((gap - 0.5 * solve.length * normal).min(initial=0.0)))
        impact = max(impact, -float(gap.min(initial=0.0)))
    return depth, impact


def _local_residual(solve: _Solve) -> float:
    """Return the local residual of a solve, relative to the part of c that forces add, c − (1 + ε) Wᵀu_B."""
    force_part = solve.problem.free_velocity - (1.0 + solve.contacts.restitution) * solve.approach
    return local_residual(solve.problem, solve.impulses, float(np.abs(force_part).max(initial=0.0)))


def judged_residual(step: Step) -> float:
    """Return the judge's residual of a step, 0 without contacts."""
    problem = step.problem
    if problem is None:
        return 0.0
    return Residual(problem).judged(problem, step.impulses)
