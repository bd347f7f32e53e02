"""A pour ends when the funnel is empty or jammed, every step is solved, and energy never grows if laws forbid it."""

import io
from pathlib import Path

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import resume_simulation, simulate
from proxbench.bench.simulation.simulation import Simulation
from proxbench.bench.simulation.view.chart import simulation_chart
from proxbench.bench.simulation.view.table import print_simulation, summary
from proxbench.problems.motion.scenes.funnel import JAM_SECONDS
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.moreau import Moreau
from rich.console import Console

SMALL = {"balls": 60}


def pour(duration: float = 3.0, **options: object) -> SimulationPlan:
    return make_simulation_plan("funnel", {**SMALL, **options}, stepper="Moreau(step=1e-3)", duration=duration)


@pytest.fixture(scope="module")
def jam() -> Simulation:
    return simulate(pour(outlet=2.0))


@pytest.fixture(scope="module")
def flow() -> Simulation:
    return simulate(pour(outlet=4.5))


def printed(simulation: Simulation) -> str:
    console = Console(file=io.StringIO(), width=120)
    print_simulation(simulation, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert isinstance(text, str)
    return text


@pytest.mark.slow
def test_a_narrow_outlet_jams_and_says_so(jam: Simulation) -> None:
    assert jam.ending == "jammed"
    assert jam.is_finished
    assert jam.state.time < jam.plan.duration
    left = SMALL["balls"] - int(jam.steps["balls_through"][-1])
    assert left > 0
    assert f"jammed at {jam.state.time:.4g} s: {left} of 60 balls rest above the outlet" in printed(jam)
    assert summary(jam)["ended"] == "jammed"


@pytest.mark.slow
def test_jammed_pile_does_not_move(jam: Simulation) -> None:
    """For another half second from the same state, nothing passes, and no ball moves by a hundredth of its radius."""
    plan, state = jam.plan, jam.state
    assert isinstance(plan.stepper, Moreau)
    rule = MidpointRule(
        plan.scene.system, plan.solver, plan.stop, plan.stepper.shortest_step(plan.scene), depth=plan.scene.depth
    )
    for step in rule.steps(state, 500):
        last = step.state
    through = jam.plan.scene.observables[0]
    assert through.compute(last) == jam.steps["balls_through"][-1]
    above = state.position[2::3] > 0.0
    moved = np.linalg.norm((last.position - state.position).reshape(-1, 3), axis=1)[above]
    assert moved.max() < 0.01 * jam.plan.scene.length


def test_the_default_outlet_lets_all_balls_through_and_the_pour_ends(flow: Simulation) -> None:
    assert flow.ending == "emptied"
    assert flow.steps["balls_through"][-1] == 60
    assert "emptied: all 60 balls are through the outlet" in printed(flow)


def test_the_count_through_the_outlet_is_that_of_balls_below_it(flow: Simulation) -> None:
    heights = flow.state.position[2::3]
    assert flow.steps["balls_through"][-1] == (heights < 0.0).sum()
    assert (np.diff(flow.steps["balls_through"]) >= 0).all()


@pytest.mark.slow
def test_a_pile_that_comes_to_rest_later_than_the_window_is_not_jammed_before_it(jam: Simulation) -> None:
    resting = jam.steps["agitation"] <= 1e-4
    rest = jam.steps["time"][-1] - jam.steps["time"][~resting].max()
    assert rest == pytest.approx(JAM_SECONDS, abs=2.1 * jam.plan.stepper.shortest_step(jam.plan.scene))


def test_every_step_of_a_pour_is_solved_to_the_tolerance(flow: Simulation) -> None:
    assert flow.steps["residual"].max() <= 1e-4
    assert not flow.unsolved.any()


@pytest.mark.slow
def test_few_steps_of_a_jam_are_unsolved_and_their_number_is_printed(jam: Simulation) -> None:
    """Sweeps stagnate on piles at rest, so that all attempts may fall short there."""
    missed = int(jam.unsolved.sum())
    assert missed <= 0.05 * jam.n_steps
    assert not jam.refuted.any()
    assert missed == 0 or f"{missed} of {jam.n_steps} steps are not solved" in printed(jam)


@pytest.mark.slow
def test_penetrations_vanish_with_projection(flow: Simulation, jam: Simulation) -> None:
    allowed = float(jam.plan.scene.options["projection"] or 0.0)
    assert jam.steps["penetration"][-1] <= 1.11 * allowed
    assert jam.steps["penetration"][jam.steps["time"] > 0.4].max() <= 0.03
    # new contacts are moved apart, too; their depths are extrapolated over half a step, in which balls of less than
    # 3 m/s move by s; the normal turns, which changes the depth by s²/2 over the distance of 2 radii
    way = 0.5 * flow.plan.stepper.shortest_step(flow.plan.scene) * 3.0 / flow.plan.scene.length
    assert flow.steps["penetration"].max() <= 1.11 * allowed + way**2 / 4.0


@pytest.mark.weekly
def test_penetrations_remain_without_projection() -> None:
    simulation = simulate(pour(0.8, outlet=1.2, projection=None))
    assert simulation.steps["penetration"][-1] > 0.03


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"friction": None}, {"restitution": None}])
def test_energy_never_grows_where_the_law_forbids_it(options: dict[str, object]) -> None:
    """Equal ε without friction, or friction without ε; contacts that part while weight closes them give O(m g²Δt²)."""
    simulation = simulate(pour(1.0, outlet=3.0, projection=None, **options))
    steps, balls = simulation.steps, SMALL["balls"]
    growth = np.diff(steps["kinetic_energy"] + steps["potential_energy"])
    mass = 2500.0 * 4.0 / 3.0 * np.pi * 0.01**3
    bound = balls * mass * (9.81 * simulation.plan.stepper.shortest_step(simulation.plan.scene)) ** 2
    assert steps["contacts"].max() > 50
    assert growth.max() <= bound
    assert growth.sum() < 0.0


@pytest.mark.weekly
def test_energy_added_by_projection_is_at_most_the_work_of_lifting_the_balls() -> None:
    simulation = simulate(pour(1.0, outlet=1.2))
    growth = np.diff(simulation.steps["kinetic_energy"] + simulation.steps["potential_energy"])
    mass = 2500.0 * 4.0 / 3.0 * np.pi * 0.01**3
    impact = simulation.steps["impact_depth"]
    # a ball that ends too deep without prior contact is lifted at the next midpoint, before it is counted
    lift = SMALL["balls"] * mass * 9.81 * 0.01 * np.maximum(impact[1:], np.append(impact[2:], 0.0))
    assert (growth <= lift + 1e-12).all()


@pytest.mark.weekly
def test_a_jammed_simulation_stays_jammed_when_it_is_resumed(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    plan = make_simulation_plan("funnel", {"balls": 20, "outlet": 0.8}, stepper="Moreau(step=1e-3)", duration=4.0)
    simulation = simulate(plan, file)
    assert simulation.ending == "jammed"
    before = simulation.n_steps
    assert resume_simulation(file, duration=8.0).n_steps == before
    assert read_simulation(file).ending == "jammed"


def test_the_chart_shows_every_column(flow: Simulation) -> None:
    panels = simulation_chart(flow).to_dict()["vconcat"]
    titles = [panel["encoding"]["y"]["title"] for panel in panels]
    assert titles == ["balls through", "contacts", "iterations", "depth / r", "energy [J]"]


@pytest.mark.slow
def test_the_command_writes_the_chart_beside_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = f"simulate funnel(balls=5) --duration 0.02 --output {tmp_path}/a.npz --chart {tmp_path}/b.svg --no-progress"
    assert run_command(line.split()) == 0
    assert f"chart   {tmp_path}/b.svg" in capsys.readouterr().out
    assert (tmp_path / "b.svg").read_text().startswith("<svg")
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")
