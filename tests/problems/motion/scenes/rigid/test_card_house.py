"""A house of cards needs the friction that the equilibrium of its cards requires, in motion as well."""

from math import tan

import pytest
from proxbench.problems import ContactProblem, ProblemError
from proxbench.problems.motion.bodies.rigid.polyhedron import convex_polyhedron
from proxbench.problems.motion.equilibrium import find_equilibrium, least_friction, problem_at_rest
from proxbench.problems.motion.mechanism import FIXED, Motion, pair_motions
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.card_house import CardHouse
from proxbench.problems.motion.scenes.rigid.prisms import prism
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create


def at_rest(house: CardHouse) -> ContactProblem:
    return problem_at_rest(house.system(), house.start())


@pytest.mark.parametrize("lean", [0.1, 0.35, 0.48])
def test_a_pair_of_cards_needs_the_friction_of_its_moments(lean: float) -> None:
    """The heads, at the height of the pair, balance the moment of the weight about the inner edge of the foot."""
    house = CardHouse(1, lean)
    _, pose = convex_polyhedron(prism(house.leaning(), house.width))
    expected = (pose[0] + 0.5 * house.foot) / house.height
    assert least_friction(at_rest(house)) == pytest.approx(expected, rel=1e-4)


def test_thin_cards_need_half_the_tangent_of_their_lean_and_load_raises_it_towards_the_tangent() -> None:
    thin = [least_friction(at_rest(CardHouse(k, 0.3, thickness=2e-5, overlap=1e-9))) for k in (1, 2, 3)]
    assert thin[0] == pytest.approx(0.5 * tan(0.3), rel=2e-3)
    assert thin[0] < thin[1] < thin[2] < tan(0.3)


def test_feet_slide_where_friction_is_too_low() -> None:
    problem = at_rest(CardHouse(1, friction=0.1))
    motions = {one.bodies: one.motion for one in pair_motions(problem, find_equilibrium(problem).mechanism)}
    assert motions[FIXED, 0] is motions[FIXED, 1] is Motion.SLIDES


@pytest.mark.parametrize("storeys", [1, 2, 4])
def test_a_house_has_its_cards_and_every_face_that_touches_has_contacts(storeys: int) -> None:
    house = CardHouse(storeys)
    pairs = storeys * (storeys + 1) // 2
    lying = storeys * (storeys - 1) // 2
    assert len(house.sections()) == 2 * pairs + lying
    # heads of pairs, feet of pairs, and both ends of each card that lies on two pairs
    assert at_rest(house).n_contacts == 4 * (pairs + 2 * pairs + 2 * lying)


@pytest.mark.weekly
@pytest.mark.parametrize(("storeys", "limit"), [(1, 0.1754), pytest.param(3, 0.3168, marks=pytest.mark.slow)])
def test_in_motion_a_house_stands_two_per_cent_above_its_limit_and_falls_two_per_cent_below(
    storeys: int, limit: float
) -> None:
    assert least_friction(at_rest(CardHouse(storeys))) == pytest.approx(limit, abs=1e-4)
    for friction, stands in ((0.98 * limit, False), (1.02 * limit, True)):
        house = CardHouse(storeys, friction=friction)
        rule = MidpointRule(house.system(), create("NSGS"), Stop(1e-4, 50_000), 1e-3)
        *_, last = rule.steps(house.start(), 300)
        assert (house.largest_displacement(last.state) < 1e-4) is stands


def test_the_scene_is_registered() -> None:
    assert make_scene("card_house(storeys=2)").observables[0].name == "moved"


def test_invalid_card_house_is_refused() -> None:
    for options, words in (
        ({"storeys": 0}, "storeys"),
        ({"lean": 0.6}, "too wide"),
        ({"thickness": -1.0}, "thickness"),
        ({"overlap": 0.5}, "overlap"),
    ):
        with pytest.raises(ProblemError, match=words):
            CardHouse(**options)
