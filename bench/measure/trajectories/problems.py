"""The problems of a run over trajectories, read from its plan; their references are simulated beforehand."""

import math
from collections.abc import Iterator

from msgspec.structs import replace

from ....problems.contact.solver import Status
from ....problems.motion.scenes.registry import make_scene
from ....problems.motion.trajectories.problem import Aggregates, EndPosition, LimitCycle, Measure, TrajectoryProblem
from ...errors import BenchError
from ...isolation.worker import Fault, RenewedWorker
from ...store.plans import KnownRecord, Limits, TrajectoryRecord
from .case import simulated
from .methods import Method, make_method, stored_method
from .task import TrajectoryTask

MIN_SEEDS = 2
"""Seeds that a standard error needs."""


def trajectory_of(record: TrajectoryRecord) -> TrajectoryProblem:
    """Return the problem of a run, its members those that the reference has."""
    known = {one.member: one.values for one in record.known if not one.failure}
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
    """Yield the record each time that a part of its reference is simulated, at last with all of it.

    Args:
        record: as far as it is known.
        limits: of one simulation, those of a case.

    Raises:
        BenchError: if the reference cannot be simulated.
    """
    known = {one.member for one in record.known}
    left = [member for member in reference_members(record) if member not in known]
    if left:
        method = _reference(record)
        task = TrajectoryTask(trajectory_of(replace(record, known=[])), method, limits.case_seconds, most_solves=10**9)
        try:
            with RenewedWorker(task, limits.case_seconds, limits.memory_bytes) as worker:
                for member in left:
                    record = _with_member(record, method, worker, member)
                    yield record
        except Fault as fault:
            raise BenchError(f"the reference of {record.name} cannot be simulated: {fault.reason}.") from None
    good = sum(not one.failure for one in record.known)
    if record.error != "limit cycle" and good < (MIN_SEEDS if record.error == "aggregates" else 1):
        why = next(one.failure for one in record.known if one.failure)
        raise BenchError(f"the reference of {record.name} came to no end: {why}; choose a shorter duration.")


def reference_members(record: TrajectoryRecord) -> list[float]:
    """Return the members whose ends the reference has: seeds that are averaged, a single motion, or no motion."""
    if record.error == "limit cycle":
        return []
    return list(record.members) if record.error == "aggregates" else [1.0]


def _reference(record: TrajectoryRecord) -> Method:
    """Return what simulates the reference; any method will do to ask a scene for the end that it knows."""
    if record.reference is None:
        return make_method("Moreau with SORprox", [1e-3])
    return stored_method(record.reference)


def _with_member(record: TrajectoryRecord, method: Method, worker: RenewedWorker, member: float) -> TrajectoryRecord:
    """Return the record with what is known of one more member."""
    scale, way, failure = record.scale, record.way, ""
    if record.error == "end position":
        about, _ = worker.ask("known")
        values, start = dict(about["values"]), dict(about["start"])
    if record.reference is not None:
        answer, _ = worker.ask("simulate", method.record.values[0], member)
        run = simulated(answer, math.inf, ())
        values, failure = run.values, "" if run.status is Status.SOLVED else run.reason
    if record.error == "end position" and not failure:
        way = max(abs(values[name] - start[name]) for name in values)
        scale = max(float(about["length"]), way)
    return replace(
        record, scale=scale, way=way, known=[*record.known, KnownRecord(member=member, values=values, failure=failure)]
    )
