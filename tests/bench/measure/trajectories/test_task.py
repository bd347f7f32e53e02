"""The times of a study are those of the clock."""

import time
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from proxbench.bench.measure.trajectories.methods import make_method
from proxbench.bench.measure.trajectories.plan import make_study_plan
from proxbench.bench.measure.trajectories.problems import trajectory_of
from proxbench.bench.measure.trajectories.task import TrajectoryTask
from proxbench.bench.plugins.describing import solver_spec
from proxbench.problems import ContactProblem, Model
from proxbench.solvers import create

PAUSE_SECONDS = 2e-3


class Holding:
    """SORprox that holds the lock of numba's compiler for some time."""

    name, model = "Holding", Model.COULOMB

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> Any:
        with global_compiler_lock:
            time.sleep(PAUSE_SECONDS)
        return create("SORprox").prepare(problem)


def test_a_solver_that_pretends_to_compile_gains_no_time() -> None:
    plan = make_study_plan("sliding_sphere", duration=0.02, members=[1.0])
    method = make_method("Holding in Moreau(step=1e-3)", [1e-6], given=solver_spec(Holding()))
    task = TrajectoryTask(trajectory_of(plan.record.trajectories[0]), method, 60.0)
    answer, _ = task.answer("simulate", (1e-6, 1.0))
    assert answer["status"] == "solved"
    assert answer["wall"] > PAUSE_SECONDS * answer["solves"] > 0.0
