"""The selected state of one contact: the usual one, a refined slip, or the candidate that violates the law least."""

import numpy as np
import pytest
from proxbench.solvers.sweeps.one_contact import (
    _slip_refined,
    planar_violation,
    solve_planar,
    solve_usual_spatial,
    spatial_violation,
)


def known_contact(rng: np.random.Generator, state: str, friction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return G, q and the impulse of a spatial contact that is open, sticks or slips."""
    root = rng.normal(size=(6, 3))
    angle, bound = rng.uniform(0.0, 2.0 * np.pi), friction if state == "slip" else 0.5 * friction
    along = np.array([0.0, np.cos(angle), np.sin(angle)])
    impulses = np.zeros(3) if state == "open" else np.array([1.0, 0.0, 0.0]) + bound * along
    velocity = {"open": np.array([0.5, 0.0, 0.0]) + along, "stick": np.zeros(3), "slip": -0.7 * along}[state]
    delassus = root.T @ root + 6.0 * np.eye(3)
    return delassus, velocity - delassus @ impulses, impulses


@pytest.mark.parametrize("state", ["open", "stick", "slip"])
def test_the_usual_state_of_a_regular_block_is_the_known_one(state: str) -> None:
    """With weak coupling, the solution is unique."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        delassus, free, impulses = known_contact(rng, state, 0.3)
        *found, is_usual = solve_usual_spatial(delassus.reshape(-1), *free, 0.3, 0.0, *(1.1 * impulses))
        assert is_usual
        assert found == pytest.approx(impulses, abs=1e-12)


def test_a_singular_block_has_no_usual_state() -> None:
    rng = np.random.default_rng(1)
    for rank in (1, 2):
        root = rng.integers(1, 5, size=(rank, 3)).astype(np.float64)
        assert not solve_usual_spatial((root.T @ root).reshape(-1), -1.0, 0.1, 0.1, 0.3, 0.0, 1.0, 0.0, 0.0)[3]


@pytest.mark.parametrize("fixed", [0.0, 0.2])
def test_a_slip_near_a_solution_is_refined_to_rounding_by_a_few_steps_of_newton(fixed: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        root, angle = rng.normal(size=(6, 3)), rng.uniform(0.0, 2.0 * np.pi)
        along, delassus = np.array([0.0, np.cos(angle), np.sin(angle)]), root.T @ root + np.eye(3)
        impulses = np.array([1.0, 0.0, 0.0]) + (fixed + 0.4) * along
        free = -0.7 * along - delassus @ impulses
        turn, normal = angle + 0.02, 1.01
        start = normal, (fixed + 0.4 * normal) * np.cos(turn), (fixed + 0.4 * normal) * np.sin(turn)
        *found, least = _slip_refined(delassus.reshape(-1), *free, 0.4, fixed, *start)
        assert found == pytest.approx(impulses, abs=1e-12)
        assert least == spatial_violation(delassus.reshape(-1), *free, 0.4, fixed, *found)


@pytest.mark.parametrize("speed", [1e-4, 1.0, 1e4])
def test_a_planar_block_of_rank_one_keeps_undetermined_friction_at_any_speed(speed: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        root = rng.uniform(0.5, 2.0, 2)
        held = speed * np.array([1.0, rng.uniform(-0.3, 0.3)])
        moved = speed * np.array([rng.uniform(1.0, 2.0), 0.0])
        delassus = np.outer(root, root)
        free = -root * (root @ (held + moved))
        found = solve_planar(*delassus.reshape(-1), *free, 0.5, 0.0, *held)
        assert found[1] == held[1]
        assert found[0] == pytest.approx(held[0] + moved[0], rel=1e-12)


def test_a_planar_contact_without_a_solution_gets_the_least_wrong_of_open_and_both_slips() -> None:
    """The block is singular and the free velocity is not in its range."""
    rng, wrong = np.random.default_rng(4), 0
    for _ in range(300):
        root, free = rng.normal(size=2), rng.normal(size=2)
        friction, fixed = rng.choice([0.0, 0.3, 2.0]), rng.choice([0.0, 0.3])
        block, old = np.outer(root, root).reshape(-1), (abs(rng.normal()), rng.normal())
        found = planar_violation(*block, *free, friction, fixed, *solve_planar(*block, *free, friction, fixed, *old))
        candidates = [(0.0, np.clip(-free[1] / block[3], -fixed, fixed))]
        coupling, normal_alone = block[1] / block[0], -free[0] / block[0]
        for side in (-1.0, 1.0):
            normal = (normal_alone - side * fixed * coupling) / (1.0 + side * friction * coupling)
            if normal >= 0.0:
                candidates.append((normal, side * (fixed + friction * normal)))
        least = min(planar_violation(*block, *free, friction, fixed, *one) for one in candidates)
        assert found <= least + 1e-12
        wrong += least > 1e-3
    assert wrong > 10
