"""Pairs of balls with their own friction coefficients: evenly distributed, permanent, and nothing else changes."""

import numpy as np
import pytest
from proxbench.problems import ProblemError
from proxbench.problems.motion.bodies.balls import BallSystem
from proxbench.problems.motion.bodies.mixed_friction import MixedFriction

ROW = np.array([[0.0, 0.0, 0.0], [0.19, 0.0, 0.0], [0.38, 0.0, 0.0]])


def balls(friction: float | MixedFriction = 0.3) -> BallSystem:
    """Three balls that can touch in a row."""
    return BallSystem(np.full(3, 0.1), np.ones(3), (), 3, friction=friction)


def test_coefficients_are_spread_evenly_and_differ_from_seed_to_seed() -> None:
    keys = np.arange(100_000)
    drawn, others = (MixedFriction(0.1, 0.9, seed)(keys) for seed in (1, 2))
    counts = np.histogram(drawn, bins=10, range=(0.1, 0.9))[0]
    assert np.abs(counts - 10_000).max() < 500  # five standard deviations
    assert abs(np.corrcoef(drawn, others)[0, 1]) < 0.02


def test_coefficients_of_seed_0_are_the_published_numbers_of_splitmix64() -> None:
    # the first outputs of the reference implementation, https://prng.di.unimi.it/splitmix64.c, from x = 0
    published = (0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F)
    drawn = MixedFriction(0.0, 1.0)(np.arange(3))
    assert drawn.tolist() == [(bits >> 11) * 2.0**-53 for bits in published]


def test_a_pair_keeps_its_coefficient_while_others_come_and_go() -> None:
    system, still = balls(MixedFriction(0.1, 0.9)), np.zeros(18)
    both = system.assemble(ROW.ravel(), still, 1e-3).contacts
    parted = ROW.copy()
    parted[0, 0] = -1.0
    one = system.assemble(parted.ravel(), still, 1e-3).contacts
    assert both is not None
    assert one is not None
    friction = [found.laws.friction_coefficient[found.laws.partner >= 0] for found in (both, one)]
    assert friction[0][both.keys == one.keys[0]] == friction[1]
    assert friction[0][0] != friction[0][1]


def test_mixed_friction_changes_nothing_but_the_contact_laws() -> None:
    velocity = np.random.default_rng(0).normal(size=18)
    mixed = balls(MixedFriction(0.1, 0.9)).assemble(ROW.ravel(), velocity, 1e-3)
    plain = balls().assemble(ROW.ravel(), velocity, 1e-3)
    assert mixed.contacts is not None
    assert plain.contacts is not None
    assert np.array_equal(mixed.free_motion, plain.free_motion)
    assert np.array_equal(mixed.contacts.keys, plain.contacts.keys)
    assert np.array_equal(mixed.contacts.restitution, plain.contacts.restitution)
    assert np.array_equal(mixed.contacts.directions.values, plain.contacts.directions.values)


def test_a_range_in_descending_order_is_refused() -> None:
    with pytest.raises(ProblemError, match="lowest first"):
        MixedFriction(0.9, 0.1)


def test_a_seed_is_a_number_of_64_bits() -> None:
    MixedFriction(0.1, 0.9, 2**64 - 1)
    for seed in (-1, 2**64):
        with pytest.raises(ProblemError, match="seed"):
            MixedFriction(0.1, 0.9, seed)
