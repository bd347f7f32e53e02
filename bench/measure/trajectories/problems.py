"""The problems of a study, read from its plan, and their references."""

import math
from collections.abc import Iterator

from msgspec.structs import replace

from ....problems.contact.solver import Status
from ....problems.motion.scenes.registry import make_scene
from ....problems.motion.trajectories.problem import Aggregates, EndPosition, LimitCycle, Measure, TrajectoryProblem
from ...errors import BenchError
from ...isolation.worker import Fault, RenewedWorker
from ...store.plans import Limits, ReferenceRecord, TrajectoryRecord
from .case import SimulationRound
from .methods import Method, make_method, stored_method
from .task import TrajectoryRequest, TrajectoryTask

MIN_SEEDS = 2
"""Least number of seeds for a standard error."""


def trajectory_of(record: TrajectoryRecord) -> TrajectoryProblem:
    """Return the problem of a study, with the known values of its reference.

    Raises:
        BenchError: if the scene no longer has a limit cycle.
    """
    known = {reference.member: reference.values for reference in record.known if not reference.failure}
    members = tuple(record.members)
    if record.error == "limit cycle":
        scene = make_scene(record.name)
        if scene.limit_cycle is None:
            raise BenchError(f"the scene {record.name} has no limit cycle; run the study again.")
        measure: Measure = LimitCycle(scene.limit_cycle, len(scene.start.position))
    elif record.error == "aggregates":
        measure = Aggregates(known)
        members = tuple(member for member in members if member in known) or members
    else:
        measure = EndPosition(next(iter(known.values()), {}), record.scale)
    return TrajectoryProblem(record.name, record.duration, members, measure)


def simulate_references(record: TrajectoryRecord, limits: Limits) -> Iterator[TrajectoryRecord]:
    """Simulate the reference, and yield the record after each member; the last one is complete.

    Args:
        record: the record with the known part of the reference.
        limits: limits of a case, which apply to one simulation.

    Raises:
        BenchError: if the reference cannot be simulated.
    """
    known = {reference.member for reference in record.known}
    missing = [member for member in reference_members(record) if member not in known]
    if missing:
        method = _reference(record)
        task = TrajectoryTask(trajectory_of(replace(record, known=[])), method, limits.case_seconds, max_solves=10**9)
        try:
            solvers = method.solver.compiled_solvers
            with RenewedWorker(task, limits.case_seconds, limits.memory_bytes, solvers) as worker:
                for member in missing:
                    record = _with_member(record, method, worker, member)
                    yield record
        except Fault as fault:
            raise BenchError(f"the reference of {record.name} cannot be simulated: {fault.reason}.") from None
    n_complete = sum(not reference.failure for reference in record.known)
    if record.error != "limit cycle" and n_complete < (MIN_SEEDS if record.error == "aggregates" else 1):
        reason = next(reference.failure for reference in record.known if reference.failure)
        raise BenchError(f"the reference of {record.name} is incomplete: {reason}; choose a shorter duration.")


def reference_members(record: TrajectoryRecord) -> list[float]:
    """Return the members of the reference: the seeds to average, one motion, or none for a known limit cycle."""
    if record.error == "limit cycle":
        return []
    return list(record.members) if record.error == "aggregates" else [1.0]


def _reference(record: TrajectoryRecord) -> Method:
    """Return the method of the reference, or any method if the scene gives its final state in closed form."""
    if record.reference is None:
        return make_method("Moreau with SORprox", [1e-3])
    return stored_method(record.reference)


def _with_member(record: TrajectoryRecord, method: Method, worker: RenewedWorker, member: float) -> TrajectoryRecord:
    """Return the record with the result of one more member."""
    scale, displacement, failure = record.scale, record.displacement, ""
    if record.error == "end position":
        ending, _ = worker.ask(TrajectoryRequest.EXACT_END)
        values, start, moved = dict(ending["values"]), dict(ending["start"]), float(ending["displacement"])
    if record.reference is not None:
        answer, _ = worker.ask(TrajectoryRequest.SIMULATE, method.record.values[0], member)
        run = SimulationRound.read(answer, math.inf)
        values, failure = run.values, "" if run.status is Status.SOLVED else run.message
        moved = run.displacement
    if record.error == "end position" and not failure:
        scale = max(float(ending["length"]), *(abs(values[name] - start[name]) for name in values))
        displacement = moved
    return replace(
        record,
        scale=scale,
        displacement=displacement,
        known=[*record.known, ReferenceRecord(member=member, values=values, failure=failure)],
    )
