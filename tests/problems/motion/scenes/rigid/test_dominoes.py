"""A wave of falling dominoes has the speed that the theory of leaning dominoes predicts."""

import numpy as np
import pytest
from known_motions import theoretical_speed, wave_speed
from proxbench.problems import ProblemError
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.dominoes import Dominoes
from proxbench.problems.motion.state import State
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


def fall(row: Dominoes, time_step: float, seconds: float, tolerance: float) -> list[State]:
    rule = MidpointRule(row.system(), create("Robust"), Stop(tolerance, 20_000), time_step)
    return [row.start(), *(step.state for step in rule.steps(row.start(), round(seconds / time_step)))]


def energies(row: Dominoes, states: list[State]) -> FloatArray:
    system = row.system()
    assert system.potential_energy is not None
    return np.array([system.kinetic_energy(one.velocity) + system.potential_energy(one.position) for one in states])


def test_dominoes_of_a_train_lean_on_each_other_and_its_rates_are_the_derivatives_of_its_angles() -> None:
    row = Dominoes()
    head, step = 0.3, 1e-6
    (angles, after, before), (rates, *_), _ = (part.T for part in row._train(head + np.array([0.0, step, -step])))
    thickness, _, height = row.size
    corners = height * np.array([np.sin(angles[1:]), np.cos(angles[1:])])  # about the lower edge of each domino
    faces = np.array([-np.cos(angles[:-1]), np.sin(angles[:-1])])
    distances = ((corners - np.array([[row.pitch], [0.0]])) * faces).sum(axis=0)
    assert distances == pytest.approx(thickness, abs=1e-15)
    derivatives = (after - before) / (2.0 * step)
    assert rates == pytest.approx(derivatives, abs=1e-8)
    assert angles[-1] == pytest.approx(np.arccos(thickness / row.pitch), abs=1e-6)


def test_forces_between_dominoes_drop_out_of_the_weighted_equations_of_motion() -> None:
    """Moments of a force at the corner of a domino, and of its friction, about both lower edges."""
    row, heads = Dominoes(friction=0.3), np.array([0.1, 0.4])
    angles, _, weights = row._train(heads)
    height = row.size[2]
    along, across = (np.array([np.sin(angles), np.cos(angles)]), np.array([np.cos(angles), -np.sin(angles)]))
    force = across[:, :-1] - row.friction * along[:, :-1]  # on the domino ahead, whose face the corner slides down
    corner = height * along[:, 1:]
    place = corner - np.array([row.pitch, 0.0])[:, None, None]
    behind = -(force[0] * corner[1] - force[1] * corner[0])
    ahead = force[0] * place[1] - force[1] * place[0]
    assert weights[1:] * behind + weights[:-1] * ahead == pytest.approx(0.0, abs=1e-15)
    assert (ahead > 0.0).all()


def test_without_friction_weights_are_rates_and_a_train_conserves_its_energy_between_impacts() -> None:
    row = Dominoes(friction=0.0)
    _, rates, weights = row._train(np.linspace(0.0, row.hitting_angle, 50))
    assert weights == pytest.approx(rates, abs=1e-12)
    thickness, _, height = row.size
    heads = np.linspace(0.0, row.hitting_angle, 2000)
    released = 0.5 * row.gravity * (height * (1.0 - np.cos(heads)) - thickness * np.sin(heads))
    speeds = np.sqrt(row.push**2 + 6.0 * released / (height**2 + thickness**2))
    assert row.intervals[0] == pytest.approx(np.trapezoid(1.0 / speeds, heads), rel=1e-4)


def test_the_theory_is_independent_of_the_push_and_of_mass_and_scales_with_gravity() -> None:
    speed = Dominoes().limit_speed
    assert Dominoes(push=12.0).limit_speed == pytest.approx(speed, rel=1e-4)
    assert Dominoes(mass=1.0).limit_speed == pytest.approx(speed, rel=1e-12)
    double = Dominoes(spacing=0.04, push=12.0, size=(0.016, 0.048, 0.096))
    assert double.limit_speed == pytest.approx(np.sqrt(2.0) * speed, rel=1e-4)
    assert Dominoes(push=12.0, gravity=4 * 9.81).limit_speed == pytest.approx(2.0 * speed, rel=1e-4)


@pytest.mark.parametrize(
    ("friction", "expected"),
    [(0.0, 1.1935640832898433), (0.1, 1.034747472760423), (0.2, 0.9126192793220393), (0.3, 0.8150261036896523)],
)
def test_the_theory_is_that_of_an_independent_program(friction: float, expected: float) -> None:
    """The program of M. Chapman (github.com/eigenmatt/domino-simulation) solves for accelerations and normal forces.

    Its equations were integrated by its classical Runge-Kutta rule with steps of 0.1 ms; ``expected`` is the
    speed between the 40th and the 41st of the default dominoes [m/s].
    """
    assert Dominoes(friction=friction).limit_speed == pytest.approx(expected, rel=2e-6)


def test_a_wave_that_cannot_run_has_no_speed() -> None:
    with pytest.raises(ProblemError, match="the wave stops"):
        _ = Dominoes(spacing=0.002, size=(0.03, 0.024, 0.048), friction=0.9, push=10.0).limit_speed
    with pytest.raises(ProblemError, match=r"friction 5\.0 do not push each other"):
        _ = Dominoes(friction=5.0).limit_speed


@pytest.mark.slow
def test_the_wave_without_friction_between_dominoes_has_the_speed_of_the_theory() -> None:
    row = Dominoes(n_dominoes=12, friction=0.0, push=12.0)
    states = fall(row, 5e-4, 0.37, 1e-5)
    assert wave_speed(row, states, 7, 11) == pytest.approx(theoretical_speed(row, 7, 11), rel=0.04)


@pytest.mark.slow
def test_the_wave_with_friction_has_the_speed_of_the_theory_and_energy_never_grows() -> None:
    row = Dominoes(n_dominoes=12, push=12.0)
    states = fall(row, 1e-3, 0.42, 1e-5)
    assert wave_speed(row, states, 6, 10) == pytest.approx(theoretical_speed(row, 6, 10), rel=0.04)
    energy = energies(row, states)
    assert np.diff(energy).max() <= 1e-5 * energy[0]
    assert energy[-1] < 0.9 * energy[0]


@pytest.mark.parametrize(("factor", "topples"), [(1.03, True), (0.97, False)])
def test_a_domino_topples_if_its_push_lifts_it_over_its_edge(factor: float, topples: bool) -> None:
    row = Dominoes(n_dominoes=1)
    pushed = row.start()
    pushed = State(0.0, pushed.position, pushed.velocity * factor * row.toppling_push / row.push)
    rule = MidpointRule(row.system(), create("Robust"), Stop(1e-8, 10_000), 1e-3)
    *_, last = rule.steps(pushed, 300)
    assert (row.angles(last.state)[0] > np.arctan2(row.size[0], row.size[2])) is np.bool_(topples)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("push=1.0", "to topple it"),
        ("spacing=0.05", "less than their height"),
        ("size=(0.1, 0.2)", "size of a box must be three edge lengths"),
        ("n_dominoes=0", "n_dominoes of a row of dominoes"),
    ],
)
def test_a_row_that_cannot_fall_is_refused(options: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make_scene(f"dominoes({options})")


def test_the_front_counts_dominoes_to_the_angle_of_their_impact() -> None:
    scene, row = make_scene("dominoes"), Dominoes()
    front = scene.observables[0]
    assert (front.name, front.rate) == ("front", "wave speed")
    turned = scene.start.position.copy().reshape(-1, 7)
    angles = np.array([1.2, row.hitting_angle, 0.5 * row.hitting_angle])
    turned[:3, 3], turned[:3, 5] = np.cos(0.5 * angles), np.sin(0.5 * angles)
    assert front.compute(State(0.0, turned.ravel(), scene.start.velocity)) == pytest.approx(2.5 * row.pitch)
