"""Simulations take the stepper's steps, judge them, and resume bit for bit after an interruption."""

import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import scipy.linalg  # noqa: F401  # so that its BLAS is loaded
from proxbench.bench.errors import BenchError, FailedSimulationError
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import BYTES_PER_ROW, resume_simulation, simulate, step_bytes
from proxbench.bench.simulation.simulation import Ending, Simulation
from proxbench.bench.simulation.step_row import step_columns
from proxbench.problems import ContactProblem, Model, judge
from proxbench.problems.contact.matrices import memory
from proxbench.problems.errors import InsufficientMemoryError
from proxbench.problems.motion.bodies.surfaces import Plane
from proxbench.problems.motion.scenes.effects import Effect, Friction, Gravity, Planar, ball_system
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.moreau import Moreau
from proxbench.problems.motion.stepping.step import AcceptedStep
from proxbench.solvers import Solution, Status, Stop, create
from threadpoolctl import threadpool_info, threadpool_limits

Pour = Callable[..., SimulationPlan]
TIMELESS = [name for name in step_columns(make_scene("pile")).names or () if name != "seconds"]


def assert_same_bits(one: Simulation, other: Simulation) -> None:
    for name in TIMELESS:
        assert one.steps[name].tobytes() == other.steps[name].tobytes(), name
    for name in ("position", "velocity", "keys", "impulses"):
        assert getattr(one.state, name).tobytes() == getattr(other.state, name).tobytes(), name
    assert one.state.time == other.state.time
    assert [state.time for state in one.states] == [state.time for state in other.states]
    for mine, its in zip(one.states, other.states, strict=True):
        for name in ("position", "velocity", "keys", "impulses"):
            assert getattr(mine, name).tobytes() == getattr(its, name).tobytes(), name


def bare_rule(plan: SimulationPlan) -> MidpointRule:
    """Moreau's rule with the settings of the plan, and nothing else."""
    assert isinstance(plan.stepper, Moreau)
    step = plan.stepper.shortest_step(plan.scene)
    return MidpointRule(plan.scene.system, plan.solver, plan.stop, step, depth=plan.scene.depth)


def stop_after(steps: int) -> Callable[[], bool]:
    checks = iter(range(steps + 1))
    return lambda: next(checks) == steps


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "step"), [("pile(balls=30)", 1e-3), ("woodpecker", 1e-4), ("tipping_box", 1e-3)])
def test_a_resumed_simulation_ends_in_the_bits_of_an_uninterrupted_one(scene: str, step: float, tmp_path: Path) -> None:
    plan = make_simulation_plan(scene, stepper=Moreau(step), duration=200 * step, states=7)
    whole = simulate(plan)
    assert whole.n_steps == 200
    assert whole.steps["contacts"][120:].any()
    part = simulate(plan, tmp_path / "part.npz", should_stop=stop_after(120))
    assert (part.n_steps, part.is_finished) == (120, False)
    resumed = resume_simulation(tmp_path / "part.npz")
    assert resumed.is_finished
    assert_same_bits(resumed, whole)
    assert_same_bits(read_simulation(tmp_path / "part.npz"), whole)


def test_without_the_stored_impulses_the_bits_would_differ(pour: Pour, tmp_path: Path) -> None:
    """The comparison above can fail: the warm start is part of the state."""
    whole = simulate(pour())
    part = simulate(pour(), should_stop=stop_after(160))
    assert len(part.state.keys)
    cold = Simulation(pour())
    cold.restore(part.steps, type(part.state)(part.state.time, part.state.position, part.state.velocity))
    stepper = bare_rule(cold.plan)
    assert stepper.step(cold.state).state.velocity.tobytes() != stepper.step(part.state).state.velocity.tobytes()
    assert whole.n_steps == 200


def test_a_simulation_takes_the_steps_of_the_bare_stepper(pour: Pour) -> None:
    plan, seen = pour(), list[tuple[int, AcceptedStep]]()
    simulation = simulate(plan, on_step=[lambda number, step: seen.append((number, step))])
    bare = list(bare_rule(plan).steps(plan.scene.start, 200))
    assert [number for number, _ in seen] == list(range(1, 201))
    for row, (_, taken), expected in zip(simulation.steps, seen, bare, strict=True):
        ((step, length),) = taken.substeps
        assert length == 1e-3 == pytest.approx(row["length"], rel=1e-9)
        assert taken.end.time == row["time"]
        assert step.state.velocity.tobytes() == expected.state.velocity.tobytes()
        assert row["contacts"] == (0 if step.contacts is None else len(step.contacts.keys))
        if step.problem is not None:
            assert row["residual"] == pytest.approx(judge(step.problem, step.impulses).residual, rel=1e-6, abs=1e-13)


def test_step_numbers_continue_after_resuming(pour: Pour, tmp_path: Path) -> None:
    seen: list[int] = []
    simulate(pour(), tmp_path / "a.npz", should_stop=stop_after(5))
    resume_simulation(tmp_path / "a.npz", should_stop=stop_after(2), on_step=[lambda number, step: seen.append(number)])
    assert seen == [6, 7]


def test_a_finished_simulation_can_be_prolonged_but_not_shortened(pour: Pour, tmp_path: Path) -> None:
    simulate(pour(120), tmp_path / "a.npz")
    with pytest.raises(BenchError, match="past the duration"):
        resume_simulation(tmp_path / "a.npz", duration=0.1)
    assert_same_bits(resume_simulation(tmp_path / "a.npz", duration=0.2), simulate(pour(200)))


def test_steps_that_miss_the_tolerance_are_counted(pour: Pour) -> None:
    simulation = simulate(pour(solver="SORprox", max_iterations=1, tolerance=1e-10))
    assert simulation.unsolved.any()
    assert not simulation.refuted.any()
    limit = simulation.statuses.index("iteration limit")
    assert set(simulation.steps["status"][simulation.unsolved]) == {limit}


WELL = 8


@dataclass(frozen=True)
class Misled:
    """A solver with one of several faults from its eighth problem on."""

    how: str
    calls: list[int]
    name: str = "Misled"
    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = False

    def supports(self, problem: ContactProblem) -> str | None:
        return "this is too many" if self.how == "decline" and len(self.calls) >= WELL - 1 else None

    def prepare(self, problem: ContactProblem) -> "Misled":
        self.calls.append(problem.n_rows)
        return self

    def solve(self, stop: Stop, start: Any = None, observe: Any = None) -> Solution:
        rows = self.calls[-1]
        if len(self.calls) >= WELL and self.how == "raise":
            raise ZeroDivisionError("oh\nno")
        if len(self.calls) >= WELL and self.how == "exit":
            raise SystemExit(7)
        wrong = np.nan if len(self.calls) >= WELL and self.how == "nan" else 0.0
        return Solution(np.full(rows, wrong), Status.SOLVED, 1)


def test_a_claim_that_the_judge_refutes_is_counted_as_unsolved(pour: Pour) -> None:
    simulation = simulate(pour(solver=Misled("lie", [])))
    assert simulation.refuted.any()
    assert (simulation.refuted == simulation.unsolved).all()


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("raise", "ZeroDivisionError: oh no"),
        ("exit", "SystemExit: 7"),
        ("nan", "no longer finite"),
        ("decline", "this is too many"),
    ],
)
def test_a_step_that_fails_is_named_and_the_steps_before_it_are_kept(
    pour: Pour, tmp_path: Path, how: str, words: str
) -> None:
    file = tmp_path / "a.npz"
    with pytest.raises(FailedSimulationError) as caught:
        simulate(pour(solver=Misled(how, [])), file)
    kept = read_simulation(file, Misled(how, []))
    message = str(caught.value)
    assert words in message
    assert f"step {kept.n_steps + 1}, from t = {kept.state.time:.6g} s, failed with Misled" in message
    assert str(file) in message
    assert "\n" not in message
    assert message.endswith("--stepper … --solver …" if how == "nan" else f"--resume {file} --solver …")
    assert 0 < (kept.steps["contacts"] > 0).sum() < WELL
    assert kept.ending is Ending.FAILED
    assert kept.failure is not None
    assert words in kept.failure.reason
    assert np.isfinite(kept.state.velocity).all()


def test_another_solver_resumes_a_stopped_simulation(pour: Pour, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    simulate(pour(), file, should_stop=iter([False] * 20 + [True]).__next__)
    resumed = resume_simulation(file, {"solver": "SORprox", "tolerance": 1e-6, "max_iterations": 9000})
    assert resumed.is_finished
    stored = read_simulation(file)
    assert (stored.plan.solver.name, stored.plan.tolerance, stored.plan.max_iterations) == ("SORprox", 1e-6, 9000)
    assert (stored.steps["residual"][21:] <= 1.1e-6).all()


@pytest.mark.slow
def test_an_interruption_in_a_recorder_leaves_whole_steps_in_the_file(pour: Pour, tmp_path: Path) -> None:
    def interrupt(number: int, step: AcceptedStep) -> None:
        if number == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(pour(), tmp_path / "a.npz", on_step=[interrupt])
    assert read_simulation(tmp_path / "a.npz").n_steps == 7
    assert_same_bits(resume_simulation(tmp_path / "a.npz"), simulate(pour()))


@pytest.mark.slow
def test_numerical_libraries_use_one_thread_during_a_simulation_only(pour: Pour) -> None:
    """Otherwise the bits of long sums, and the processor time of steps, depend on the number of cores."""

    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    during: list[int] = []
    with threadpool_limits(2):
        before = threads()
        simulate(pour(), on_step=[lambda *_: during.extend(threads())])
        assert threads() == before
    assert set(during) == {1}
    assert max(before) > 1


def test_the_file_is_written_at_intervals(pour: Pour, tmp_path: Path) -> None:
    seen: list[int] = []
    file = tmp_path / "a.npz"
    simulate(
        pour(5),
        file,
        checkpoint_seconds=0.0,
        on_progress=lambda simulation: seen.append(read_simulation(file).n_steps),
    )
    assert seen == [1, 2, 3, 4, 5]


def test_an_output_that_exists_is_replaced_by_force_alone(pour: Pour, tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    file.write_bytes(b"precious")
    with pytest.raises(BenchError, match="exists already"):
        simulate(pour(3), file)
    assert file.read_bytes() == b"precious"
    assert simulate(pour(3), file, force=True).file == file
    assert read_simulation(file).n_steps == 3


def test_a_folder_gets_a_file_named_after_the_scene(pour: Pour, tmp_path: Path) -> None:
    simulation = simulate(pour(1), tmp_path / "new" / "folder")
    assert simulation.file is not None
    assert simulation.file.parent == tmp_path / "new" / "folder"
    assert simulation.file.name.startswith("pile-")
    assert [file.name for file in simulation.file.parent.iterdir()] == [simulation.file.name]


@pytest.mark.parametrize(
    "solver",
    [
        "SORprox",
        "SORprox(form='factors')",
        "JORprox(relaxation=0.3)",
        "Refined(ClarabelCoulomb)",
        "Refined(CvxpyCoulomb)",
    ],
)
def test_a_solver_may_be_given_no_limit_of_time(pour: Pour, solver: str) -> None:
    state = simulate(pour(160)).state
    plan = pour()
    problem = bare_rule(plan).step(state).problem
    assert problem is not None
    solution = create(solver).prepare(problem).solve(Stop(1e-4, 2000, float("inf")))
    assert solution.status is Status.SOLVED


@pytest.mark.parametrize(("states", "kept"), [(2, 4), (100, 11)])
def test_memory_that_does_not_suffice_for_a_step_and_the_states_is_named_before_the_first_step(
    states: int, kept: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At most twice the requested number of states are kept, and at most one more than steps; writing copies them.

    The first state is already in memory.
    """
    plan = make_simulation_plan("pile", {"balls": 10}, duration=10.0 * make_scene("pile").step_size, states=states)
    start = plan.scene.start
    state_bytes = start.position.nbytes + start.velocity.nbytes
    monkeypatch.setattr(memory, "SMALL_BYTES", 0)

    def simulate_with(available: int, output: Path | None) -> int:
        monkeypatch.setattr(memory, "available_bytes", lambda: available)
        return simulate(plan, output).n_steps

    file = tmp_path / "a.npz"
    for n_states, output in ((kept - 1, None), (2 * kept - 1, file)):
        least = n_states * state_bytes + int(step_bytes(plan.scene))
        wanted = rf"for a step and {kept} states of pile, but .* available; keep fewer"
        with pytest.raises(InsufficientMemoryError, match=wanted):
            simulate_with(least - 1, output)
        assert not file.exists()
        assert simulate_with(least, output) == 10


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"planar": True}])
def test_a_settled_heap_has_the_rows_whose_memory_is_required_before_its_first_step(options: dict[str, object]) -> None:
    plan = make_simulation_plan("pile", {"balls": 50, **options}, stepper="Moreau(step=2e-3)", duration=1.0)
    step = bare_rule(plan).step(simulate(plan).state)
    assert step.problem is not None
    assert step_bytes(plan.scene) <= BYTES_PER_ROW * step.problem.n_rows <= 2.0 * step_bytes(plan.scene)


@pytest.mark.parametrize("effects", [[Friction(0.3)], [], [Friction(0.3), Planar()], [Planar()]])
def test_a_step_of_touching_balls_takes_at_least_the_memory_that_is_required_before_it(
    effects: Sequence[Effect],
) -> None:
    """The balls are the nodes of a cubic or square lattice, and take less than twice that memory per row."""
    dimension = 2 if Planar() in effects else 3
    n_side, ground, upward = (30, 10)[dimension - 2], np.zeros(dimension), np.eye(dimension)[-1]
    nodes = np.stack(np.meshgrid(*[np.arange(n_side)] * dimension), axis=-1).reshape(-1, dimension)
    n_balls = len(nodes)
    plane = Plane(tuple(ground), tuple(upward))
    system = ball_system(np.full(n_balls, 0.5), np.ones(n_balls), [plane], [Gravity(), *effects])
    start = State(0.0, (0.999 * (nodes + 0.5)).ravel(), system.without_spin(np.zeros(nodes.shape)))
    rule = MidpointRule(system, create("SORprox"), Stop(1e-16, 5), 1e-3)
    rule.step(start)  # compiles, and allocates what later steps share
    tracemalloc.start()
    step = rule.step(start)
    _, n_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert step.problem is not None
    assert BYTES_PER_ROW * step.problem.n_rows <= n_bytes <= 2 * BYTES_PER_ROW * step.problem.n_rows


def test_joints_that_cannot_be_closed_in_the_available_memory_are_refused_before_the_first_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = make_simulation_plan("chain", {"n_links": 40}, stepper="Moreau", duration=0.01, states=1)
    monkeypatch.setattr(memory, "SMALL_BYTES", 0)
    n_dofs = len(plan.scene.start.velocity)
    n_rows = 3 * n_dofs // 6  # a ball joint has three rows for the six coordinates of a link
    closing = 8 * n_rows * (n_dofs + 4 * n_rows)
    monkeypatch.setattr(memory, "available_bytes", lambda: closing)
    with pytest.raises(InsufficientMemoryError, match=r"for a step and .* of chain, but"):
        simulate(plan, on_step=[lambda *_: pytest.fail("a step was taken")])
    monkeypatch.setattr(memory, "available_bytes", lambda: 3 * closing)
    assert simulate(plan).n_steps > 0
