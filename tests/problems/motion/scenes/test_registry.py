"""Scenes by name: options have types and are checked, and an effect that is switched off is omitted."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.scenes.registry import SCENES, make_scene
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        ("funel", {}, "'funnel'"),
        ("funnel", {"ball": 3}, "'balls'"),
        ("pile", {"outlet": 3.0}, "no option 'outlet'"),
        ("woodpecker", {"balls": 3}, "no option 'balls'"),
        ("funnel", {"balls": 0}, "balls must be a whole number between 1 and 1,000,000, got 0"),
        ("funnel", {"balls": 2.5}, "balls must be a whole number"),
        ("funnel", {"balls": True}, "balls must be a whole number"),
        ("funnel", {"seed": -1}, "seed"),
        ("funnel", {"outlet": -1.0}, "outlet"),
        ("funnel", {"outlet": None}, "outlet"),
        ("funnel", {"friction": float("nan")}, "friction"),
        ("funnel", {"gravity": float("inf")}, "gravity"),
        ("funnel", {"restitution": 1.1}, "between 0 and 1"),
        ("funnel", {"drag": "much"}, "drag must be a number"),
        ("funnel", {"planar": 1}, "planar must be true or false"),
        ("woodpecker", {"start": "publshed"}, "'published'"),
    ],
)
def test_a_wrong_name_or_value_gets_one_sentence(scene: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError) as caught:
        make_scene(scene, options)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", SCENES)
def test_every_option_has_a_default_that_its_own_check_accepts(name: str) -> None:
    scene = make_scene(name)
    for option, described in SCENES[name].options.items():
        assert described.checked(option, described.default) == described.default == scene.options[option]


def test_numpy_numbers_are_accepted_and_converted_to_python_numbers() -> None:
    scene = make_scene("funnel", {"balls": np.int64(3), "friction": np.float32(0.5), "outlet": 3})
    assert [type(scene.options[name]) for name in ("balls", "friction", "outlet")] == [int, float, float]


@pytest.mark.parametrize(
    ("options", "dofs", "rows"),
    [({}, 6, 3), ({"friction": None}, 3, 1), ({"planar": True}, 3, 2), ({"planar": True, "friction": None}, 2, 1)],
)
def test_disabling_an_effect_removes_its_rows_and_degrees_of_freedom(
    options: dict[str, object], dofs: int, rows: int
) -> None:
    system = make_scene("funnel", {"balls": 4, **options}).system
    assert isinstance(system, BallSystem)
    assert (system.dofs_per_ball, system.rows_per_contact) == (dofs, rows)


@pytest.mark.parametrize("off", ["gravity", "drag", "spring"])
def test_an_acceleration_switched_off_is_not_computed(off: str) -> None:
    everything = {"balls": 2, "gravity": 1.0, "drag": 1.0, "spring": 1.0}
    systems = [make_scene("pile", given).system for given in (everything, {**everything, off: None})]
    assert [len(system.accelerations) for system in systems if isinstance(system, BallSystem)] == [3, 2]


def test_only_a_scene_with_an_outlet_counts_the_balls_that_leave() -> None:
    pour = make_scene("funnel", {"balls": 3})
    through = next(one for one in pour.observables if one.name == "balls_through")
    fallen = np.array([0.0, 0.0, -1.0, 1.0, -1.0, 1.0, 0.0, 0.0, -1e-9])
    assert through.compute(State(0.0, fallen, pour.start.velocity)) == 2
    for closed in ("pile", "woodpecker", "funnel(outlet=0.0)"):
        assert not make_scene(closed).observables
        assert make_scene(closed).ending is None


@pytest.mark.parametrize(
    ("name", "options"),
    [("funnel", {"balls": 5, "spring": 0.3}), ("pile", {"balls": 5, "planar": True}), ("woodpecker", {})],
)
def test_energy_is_kept_to_second_order_while_nothing_touches(name: str, options: dict[str, object]) -> None:
    """Weight and springs conserve T + V; halving Δt divides the error of a free flight by four, down to rounding."""
    scene = make_scene(name, options)
    # the woodpecker starts with its sleeve jammed; tilted back, it falls freely
    free = scene.start.position + (np.array([0.0, 0.05, 0.0]) if name == "woodpecker" else 0.0)

    def drift(step_size: float) -> float:
        state = State(0.0, free, scene.start.velocity)
        energy = scene.kinetic_energy(state.velocity) + scene.potential_energy(state.position)
        stepper = MidpointRule(scene.system, create("SORprox"), Stop(), step_size)
        for step in stepper.steps(state, round(1e-3 / step_size)):
            assert step.contacts is None
            state = step.state
        return abs(scene.kinetic_energy(state.velocity) + scene.potential_energy(state.position) - energy) / abs(energy)

    coarse, fine = drift(1e-4), drift(5e-5)
    assert max(coarse, fine) < 1e-13 or coarse / fine == pytest.approx(4.0, rel=0.01)


def test_forces_are_the_negative_gradient_of_the_potential_energy() -> None:
    """h = −∂V/∂q of the woodpecker, by central differences."""
    scene = make_scene("woodpecker", {"start": "cycle"})
    q, h = scene.start.position + np.array([0.0, 0.02, 0.0]), 1e-6
    assembly = scene.system.assemble(q, np.zeros(3), 1.0)
    force = np.linalg.solve(assembly.inverse_mass.matrix.toarray(), assembly.free_motion)
    slope = [(scene.potential_energy(q + h * e) - scene.potential_energy(q - h * e)) / (2 * h) for e in np.eye(3)]
    assert force == pytest.approx(-np.array(slope), rel=1e-6)


def test_the_woodpecker_without_friction_has_one_row_a_contact() -> None:
    start = make_scene("woodpecker", {"start": "cycle"}).start
    for friction, rows in ((0.3, 2), (None, 1)):
        system = make_scene("woodpecker", {"friction": friction}).system
        contacts = system.assemble(start.position + np.array([0.0, -1e-3, 0.0]), start.velocity, 1e-5).contacts
        assert contacts is not None
        assert contacts.width == rows
        assert contacts.directions.to_csc().shape == (3, rows)
