"""Problems of rigid bodies have the properties that their names state: redundant, of known mass ratio, or falling."""

import numpy as np
import pytest
from proxbench.bench.simulation.generation.body_problems import ARCH_LIMITS, BodyRecipe, body_problem, body_recipes
from proxbench.bench.simulation.generation.box_scenes import BoxPile, BoxTable, BoxTrain
from proxbench.problems import ContactProblem, ProblemError, load
from proxbench.problems.exchange.catalog import SUITES, is_shipped
from proxbench.problems.exchange.families import family_of
from proxbench.problems.motion.bodies.rigid.starts import check_start
from proxbench.problems.motion.equilibrium import find_equilibrium
from proxbench.problems.motion.scenes.rigid.boxes import BoxStack

FROZEN = [name for name in SUITES["bodies"] if is_shipped(name)]


def rank(problem: ContactProblem) -> int:
    assert problem.factors is not None
    return int(np.linalg.matrix_rank(problem.factors.scaled_directions.toarray()))


def delassus(problem: ContactProblem) -> np.ndarray:
    """Return G, in which the principal axes of bodies, whose signs differ between machines, do not appear."""
    assert problem.factors is not None
    scaled = problem.factors.scaled_directions
    return np.asarray((scaled.T @ scaled).toarray())


def masses(problem: ContactProblem) -> np.ndarray:
    assert problem.factors is not None
    return problem.factors.inverse_mass.root_diagonal.reshape(-1, 6)[:, 0] ** -2.0


def test_small_problems_of_every_family_are_frozen() -> None:
    assert 10 <= len(FROZEN) < len(body_recipes())
    assert {family_of(name) for name in FROZEN} == {family_of(name) for name in SUITES["bodies"]}
    assert max(load(name).n_contacts for name in FROZEN) <= 150


@pytest.mark.parametrize("name", [name for name in FROZEN if body_recipes()[name].step == 0])
def test_frozen_first_steps_are_remade_to_rounding(name: str) -> None:
    """The terms of c are velocities of bodies, which cancel in joints; c inherits their rounding."""
    made, frozen = body_problem(name), load(name)
    assert made.provenance == frozen.provenance
    rounding = 10.0 * np.finfo(float).eps * np.abs(body_recipes()[name].scene.start().velocity).max()
    for one, other, of_terms in (
        (made.free_velocity, frozen.free_velocity, rounding),
        (delassus(made), delassus(frozen), 0.0),
    ):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13 * np.abs(other).max() + of_terms)
    assert body_problem(name).digest == made.digest


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FROZEN if body_recipes()[name].step > 0])
def test_frozen_later_steps_are_remade_to_the_accuracy_of_the_steps_before(name: str) -> None:
    made, frozen = body_problem(name), load(name)
    for one, other in ((made.free_velocity, frozen.free_velocity), (delassus(made), delassus(frozen))):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * np.abs(other).max())
    assert body_problem(name).digest == made.digest


@pytest.mark.parametrize(
    ("name", "deficiency"),
    [
        ("bodies-stack-10", 60),
        ("bodies-arch-7-thick", 54),
        ("bodies-table-4-1e4", 282),
        ("bodies-four-bar", 3),
        ("bodies-chain-20", 0),
        ("bodies-ball-on-chain-1e4", 0),
        ("bodies-train-10", 87),
        ("bodies-wall", 300),
        ("bodies-pendulum", 0),
    ],
)
def test_faces_and_closed_linkages_are_redundant(name: str, deficiency: int) -> None:
    problem = load(name)
    assert problem.n_rows - rank(problem) == deficiency


@pytest.mark.parametrize(("name", "heaviest"), [("bodies-stack-10-top-1e6", 9), ("bodies-stack-10-bottom-1e6", 0)])
def test_masses_of_a_stack_differ_by_the_ratio_of_its_name(name: str, heaviest: int) -> None:
    found = masses(load(name))
    assert found.max() / found.min() == pytest.approx(1e6)
    assert found.argmax() == heaviest


@pytest.mark.parametrize("stones", [pytest.param(n, marks=pytest.mark.slow if n > 50 else ()) for n in ARCH_LIMITS])
def test_a_thick_arch_stands_and_a_thin_one_does_not(stones: int) -> None:
    assert find_equilibrium(body_problem(f"bodies-arch-{stones}-thick")).can_stand
    assert not find_equilibrium(body_problem(f"bodies-arch-{stones}-thin")).can_stand


@pytest.mark.parametrize(
    ("name", "stands"),
    [
        ("bodies-stack-10", True),
        ("bodies-table-4-1e4", True),
        ("bodies-cards-3", True),
        ("bodies-cards-3-slipping", False),
        ("bodies-arch-13-sliding", False),
        ("bodies-box-sticking", True),
        ("bodies-box-sliding", False),
        ("bodies-box-tipping", False),
        ("bodies-wall", True),
    ],
)
def test_equilibrium_agrees_with_the_name_of_the_problem(name: str, stands: bool) -> None:
    assert find_equilibrium(body_problem(name)).can_stand == stands


def test_boxes_of_a_pile_are_apart_and_within_walls_at_the_start() -> None:
    pile = BoxPile(60)
    system, position = pile.system(), pile.start().position
    assert len(system.contacts_within(system.poses(position), 0.0).gap) == 0
    walls = {body for body, _ in zip(system.fixed, range(5), strict=True)}
    assert len(walls) == 5
    half = 0.5 * pile.side * pile.pitch
    for direction in (0, 1):
        assert np.abs(system.centres(position)[:, direction]).max() < half
    pushed = pile.start()
    pushed.position[0] += 2.0 * half
    assert len(system.contacts_within(system.poses(pushed.position), 0.0).gap) > 0


@pytest.mark.parametrize("shift", [(-1, 0), (1, 0), (0, -1), (0, 1)])
def test_each_wall_keeps_boxes_inside(shift: tuple[int, int]) -> None:
    pile = BoxPile(1)
    state = pile.start()
    state.position[:2] = 0.5 * pile.side * pile.pitch * np.array(shift)
    system = pile.system()
    found = system.contacts_within(system.poses(state.position), 0.0)
    assert len(found.gap) > 0
    assert np.abs(found.normal[:, :2] @ shift) == pytest.approx(np.ones(len(found.gap)))


def test_a_table_stands_on_four_corners_of_each_post() -> None:
    table = BoxTable(3)
    system = table.system()
    found = system.contacts_within(system.poses(table.start().position), 0.0)
    assert len(found.gap) == 8 * 9
    assert found.gap == pytest.approx(np.full(72, -1e-9), abs=1e-12)


def test_joints_of_a_train_close_and_only_its_first_box_moves() -> None:
    train = BoxTrain(4, ratio=5.0, speed=2.0)
    system, state = train.system(), train.start()
    check_start(system, state)
    assert system.twists(state.velocity)[:, 0].tolist() == [2.0, 0.0, 0.0, 0.0]
    assert system.masses.tolist() == [5.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("make", [lambda: BoxPile(0), lambda: BoxTable(2, ratio=0.0), lambda: BoxTrain(2, mass=-1.0)])
def test_numbers_that_are_not_positive_are_refused(make: object) -> None:
    with pytest.raises(ProblemError, match="must be positive"):
        make()  # type: ignore[operator]


def test_boxes_of_a_drum_touch_staves_that_they_cannot_move_and_a_struck_wall_its_ball() -> None:
    drum = load("bodies-drum-24")
    heaviness = masses(drum)
    assert heaviness[24:] == pytest.approx(np.full(24, 1e9 * heaviness[0]))
    staves = heaviness > heaviness[0]
    moved = np.abs(drum.factors.scaled_directions.toarray()).reshape(-1, 6, drum.n_rows).sum(axis=1) > 0.0
    assert moved[staves].any()
    assert (moved[staves].any(axis=0) <= moved[~staves].any(axis=0)).all()
    struck = body_problem("bodies-wall-struck")
    ball = np.abs(struck.factors.scaled_directions.toarray()[-6:]).sum(axis=0) > 0.0
    assert 0 < ball.sum() < struck.n_rows


def test_step_without_contacts_cannot_become_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(body_recipes(), "bodies-apart", BodyRecipe(BoxPile(2)))
    with pytest.raises(ProblemError, match="no contact is active in step 0 of the scene of 'bodies-apart'"):
        body_problem("bodies-apart")


def test_a_first_step_is_not_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(body_recipes(), "bodies-two", BodyRecipe(BoxStack(2), stop=None))  # type: ignore[arg-type]
    assert body_problem("bodies-two").n_contacts == 8
