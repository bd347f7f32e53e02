"""What a study has to do, as far as its plan says so: points, simulations, and fixed steps."""

from collections.abc import Iterable
from dataclasses import dataclass

from ....problems.motion.stepping.moreau import Moreau
from ...report.layout.text import counted
from ...store.plans import TrajectoryRecord
from .methods import Method, scaled_stepper


@dataclass(frozen=True)
class Workload:
    """The work of a study.

    Attributes:
        points: values of all ladders.
        simulations: one for each point and member, and those of the references.
        fixed_steps: steps of all simulations whose step size is fixed.
    """

    points: int
    simulations: int
    fixed_steps: int

    @property
    def words(self) -> str:
        """The work in one line."""
        steps = f", at least {counted(self.fixed_steps, 'step')}" if self.fixed_steps else ""
        return f"{counted(self.points, 'point')}, {counted(self.simulations, 'simulation')}{steps}"


def compute_workload(methods: Iterable[Method], trajectories: Iterable[TrajectoryRecord]) -> Workload:
    """Return the work of ``methods`` on ``trajectories``; variable steps are not known beforehand."""
    points = simulations = steps = 0
    several = list(methods)
    for trajectory in trajectories:
        for method in several:
            points += len(method.record.values)
            simulations += len(method.record.values) * len(trajectory.members)
            steps += sum(_fixed_steps(method, value, trajectory) for value in method.record.values)
        if trajectory.reference is not None:
            simulations += len(trajectory.members) if trajectory.error == "aggregates" else 1
    return Workload(points, simulations, steps)


def _fixed_steps(method: Method, value: float, trajectory: TrajectoryRecord) -> int:
    stepper = method.setting(value)[0]
    if not isinstance(stepper, Moreau) or stepper.step is None:
        return 0
    are_factors = trajectory.error != "aggregates"
    factors = trajectory.members if are_factors else [1.0] * len(trajectory.members)
    made = (scaled_stepper(stepper, factor, trajectory.duration) for factor in factors)
    return sum(round(trajectory.duration / one.step) for one in made if isinstance(one, Moreau) and one.step)
