"""The times of a study are those of the clock."""

from holding_solver import PAUSE_SECONDS, Holding
from proxbench.bench.measure.trajectories.methods import make_method
from proxbench.bench.measure.trajectories.plan import make_study_plan
from proxbench.bench.measure.trajectories.problems import trajectory_of
from proxbench.bench.measure.trajectories.task import TrajectoryTask
from proxbench.bench.plugins.describing import solver_spec


def test_a_solver_that_pretends_to_compile_gains_no_time() -> None:
    plan = make_study_plan("sliding_sphere", duration=0.02, members=[1.0])
    method = make_method("Holding in Moreau(step=1e-3)", [1e-6], given=solver_spec(Holding()))
    task = TrajectoryTask(trajectory_of(plan.record.trajectories[0]), method, 60.0)
    answer, _ = task.answer("simulate", (1e-6, 1.0))
    assert answer["status"] == "solved"
    assert answer["wall"] > PAUSE_SECONDS * answer["solves"] > 0.0
