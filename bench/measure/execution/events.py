"""Events that a run reports while it is measured."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...store.plans import TrajectoryRecord


@dataclass(frozen=True)
class RunStarted:
    """The run has started.

    Attributes:
        run_dir: folder of the run.
        total: number of cases.
        done: number of finished cases.
        points: number of points of all cases of a study, for its progress; 0 in other runs.
        points_done: number of measured points of a study.
        work: the work of a study in one line; empty in other runs.
    """

    run_dir: Path
    total: int
    done: int
    points: int = 0
    points_done: int = 0
    work: str = ""


@dataclass(frozen=True)
class ReferenceSimulated:
    """The reference of a trajectory is available before the measurements: newly simulated, or stored earlier."""

    trajectory: TrajectoryRecord


@dataclass(frozen=True)
class ProblemStarted:
    """Pass ``number`` over the cases of a problem has started, counted from 0 to ``passes`` - 1."""

    problem: str
    number: int = 0
    passes: int = 1


@dataclass(frozen=True)
class PointFinished:
    """A round of a point has been measured; if it is the first one, the point is stored."""

    problem: str
    solver: str
    tolerance: float


@dataclass(frozen=True)
class CaseFinished:
    """One case has been completed and stored, as number ``done`` of ``total``."""

    problem: str
    solver: str
    outcome: str
    done: int
    total: int


@dataclass(frozen=True)
class ProblemPassFinished:
    """One pass over the cases of a problem is complete.

    Attributes:
        problem: name of the problem.
        done: number of complete passes over problems; on a cluster, of complete problems, with all their passes.
        total: number of all passes over problems; on a cluster, of all problems.
    """

    problem: str
    done: int
    total: int


Event = RunStarted | ReferenceSimulated | ProblemStarted | PointFinished | CaseFinished | ProblemPassFinished
"""Any event of a run."""

OnEvent = Callable[[Event], None]
"""A function that is called with each event."""
