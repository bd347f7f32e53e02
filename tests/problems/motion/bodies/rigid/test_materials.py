"""Coefficients by pair of materials: one for each pair in either order, and no missing pair."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.rigid.materials import MaterialPairs
from proxbench.problems.motion.bodies.rigid.rigid_bodies import FixedBody
from proxbench.problems.motion.bodies.rigid.round_shapes import Sphere
from proxbench.problems.motion.bodies.rigid.shapes import HalfSpace
from proxbench.problems.motion.scenes.effects import Friction, Restitution, ball_system
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.problems.motion.scenes.scene import GROUND

COEFFICIENTS = {("steel", "steel"): 0.15, ("wood", "steel"): 0.4, ("wood", "rubber"): 0.9, ("steel", "rubber"): 0.8}


def test_each_pair_of_bodies_has_the_coefficient_of_its_materials_in_either_order() -> None:
    pairs = MaterialPairs(("steel", "wood", "steel", "rubber"), COEFFICIENTS, n_fixed=1)
    keys = np.array([0 * 4 + 1, 0 * 4 + 2, 1 * 4 + 2, 1 * 4 + 3, 2 * 4 + 3])
    assert pairs(keys).tolist() == [0.4, 0.15, 0.4, 0.9, 0.8]


def test_a_missing_pair_is_named_unless_both_bodies_are_fixed_or_the_same() -> None:
    with pytest.raises(ProblemError, match="wood on wood is missing"):
        MaterialPairs(("wood", "steel", "wood"), COEFFICIENTS)
    MaterialPairs(("steel", "wood", "rubber", "rubber"), COEFFICIENTS, n_fixed=2)


def test_balls_accept_material_pairs_for_friction_and_restitution() -> None:
    friction = MaterialPairs(("steel", "wood", "rubber"), COEFFICIENTS, n_fixed=1)
    restitution = MaterialPairs(("steel", "wood", "rubber"), {**COEFFICIENTS, ("steel", "rubber"): 0.3}, n_fixed=1)
    effects = (Friction(friction), Restitution(restitution))
    system = ball_system(np.full(2, 0.1), np.ones(2), [GROUND], effects)
    position = np.array([0.0, 0.0, 0.09, 1.0, 0.0, 0.09])
    contacts = system.assemble(position, np.zeros(12), 1e-3).contacts
    assert contacts is not None
    assert contacts.laws.friction_coefficient[1::2].tolist() == [0.8, 0.9]
    assert contacts.restitution[::3].tolist() == [0.3, 0.9]


def test_materials_of_other_bodies_are_refused() -> None:
    pairs, words = MaterialPairs(("steel",) * 3, COEFFICIENTS), "of 3 bodies, but there are 2; give one material per"
    with pytest.raises(ProblemError, match=f"friction names the materials {words}"):
        ball_system(np.ones(1), np.ones(1), [GROUND], [Friction(pairs)])
    with pytest.raises(ProblemError, match=f"restitution_normal names the materials {words}"):
        ball_system(np.ones(1), np.ones(1), [GROUND], [Restitution(pairs)])
    with pytest.raises(ProblemError, match=f"friction names the materials {words}"):
        rigid_bodies([Sphere(1.0)], np.ones(1), [FixedBody(HalfSpace())], [Friction(pairs)])
    with pytest.raises(ProblemError, match=f"restitution_normal names the materials {words}"):
        rigid_bodies([Sphere(1.0)], np.ones(1), [FixedBody(HalfSpace())], [Restitution(pairs)])


@pytest.mark.parametrize("value", [-0.1, float("inf"), float("nan")])
def test_a_coefficient_out_of_range_is_named(value: float) -> None:
    with pytest.raises(ProblemError, match="steel on wood must be finite"):
        MaterialPairs(("steel",), {("steel", "wood"): value})
