"""A step of rigid bodies gives the problem that follows from their masses, velocities and contact points."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError, judge, load
from proxbench.problems.exchange.formats.rigid_bodies import problem_of_arrays
from proxbench.problems.exchange.repair import Repair
from proxbench.solvers import solve

STEP, GRAVITY = 0.01, np.array([0.0, 0.0, -10.0])


def box_on_the_ground(velocity: Any = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """Return a cube of 2 kg with edges of 1 m on its four lower corners."""
    corners = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
    return {
        "mass": np.array([2.0]),
        "inertia": np.full((1, 3), 2.0 / 6.0),
        "position": np.array([[0.0, 0.0, 0.5]]),
        "velocity": np.array([velocity], dtype=float),
        "angular_velocity": np.zeros((1, 3)),
        "gravity": GRAVITY,
        "time_step": np.array(STEP),
        "body_1": np.full(4, -1),
        "body_2": np.zeros(4, dtype=int),
        "point": corners,
        "normal": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "mu": np.array(0.5),
    }


def after(arrays: dict[str, Any], impulses: np.ndarray) -> np.ndarray:
    """Return the six velocities of the body after the step, by the Newton–Euler equations from the forces."""
    problem = problem_of_arrays(arrays, Repair())
    assert problem.factors is not None
    motion = problem.factors.free_motion
    assert motion is not None
    return motion + problem.factors.inverse_mass.times(problem.factors.force_directions @ impulses)


def test_a_box_at_rest_stays_and_its_weight_is_carried() -> None:
    arrays = box_on_the_ground()
    problem = problem_of_arrays(arrays, Repair())
    solution = solve(problem, tolerance=1e-12)
    assert judge(problem, solution.impulses).residual <= 1e-12
    assert solution.impulses[::3].sum() == pytest.approx(2.0 * 10.0 * STEP, rel=1e-9)
    assert np.abs(after(arrays, solution.impulses)).max() <= 1e-10
    assert problem.free_fall == pytest.approx(10.0 * STEP)


def test_a_box_that_slides_is_braked_by_mu_g_along_its_path() -> None:
    arrays = box_on_the_ground(velocity=(3.0, 4.0, 0.0))
    arrays["position"] = np.array([[0.0, 0.0, 1e-9]])  # no lever, so that it does not tip
    impulses = solve(problem_of_arrays(arrays, Repair()), tolerance=1e-12).impulses
    moved = after(arrays, impulses)
    assert moved[:3] == pytest.approx(np.array([0.6, 0.8, 0.0]) * (5.0 - 0.5 * 10.0 * STEP), abs=1e-8)


def test_newtons_impact_law_holds_for_what_approaches() -> None:
    arrays = box_on_the_ground(velocity=(0.0, 0.0, -3.0)) | {"restitution": np.array(0.5), "gravity": np.zeros(3)}
    impulses = solve(problem_of_arrays(arrays, Repair()), tolerance=1e-12).impulses
    assert after(arrays, impulses)[2] == pytest.approx(1.5, abs=1e-9)
    leaving = box_on_the_ground(velocity=(0.0, 0.0, 3.0)) | {"restitution": np.array(0.5)}
    assert solve(problem_of_arrays(leaving, Repair()), tolerance=1e-12).impulses.tolist() == [0.0] * 12


def test_an_open_contact_may_close_within_the_step_and_not_more() -> None:
    arrays = box_on_the_ground(velocity=(0.0, 0.0, -3.0)) | {"distance": np.full(4, 0.02), "gravity": np.zeros(3)}
    impulses = solve(problem_of_arrays(arrays, Repair()), tolerance=1e-12).impulses
    assert after(arrays, impulses)[2] == pytest.approx(-0.02 / STEP, abs=1e-9)


@given(st.integers(0, 10_000))
def test_relative_velocities_are_those_of_the_contact_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    quaternion, normal = rng.normal(size=(2, 4)), rng.normal(size=(3, 3))
    arrays = {
        "mass": rng.uniform(1, 2, 2),
        "inertia": rng.uniform(1, 2, (2, 3)),
        "orientation": quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
        "position": rng.normal(size=(2, 3)),
        "velocity": rng.normal(size=(2, 3)),
        "angular_velocity": rng.normal(size=(2, 3)),
        "gravity": np.zeros(3),
        "time_step": np.array(0.1),
        "body_1": np.array([0, 1, -1]),
        "body_2": np.array([1, 0, 0]),
        "point": rng.normal(size=(3, 3)),
        "normal": normal / np.linalg.norm(normal, axis=1, keepdims=True),
        "mu": rng.uniform(0, 1, 3),
    }
    c = problem_of_arrays(arrays, Repair()).free_velocity.reshape(3, 3)
    for k, (one, two) in enumerate(zip(arrays["body_1"], arrays["body_2"], strict=True)):
        relative = np.zeros(3)
        for body, sign in ((two, 1.0), (one, -1.0)):
            if body >= 0:
                lever = arrays["point"][k] - arrays["position"][body]
                relative += sign * (arrays["velocity"][body] + np.cross(arrays["angular_velocity"][body], lever))
        assert c[k, 0] == pytest.approx(relative @ arrays["normal"][k], abs=1e-12)
        assert np.linalg.norm(c[k]) == pytest.approx(np.linalg.norm(relative), rel=1e-12)


def test_principal_inertia_turns_with_the_body() -> None:
    half = np.sqrt(0.5)
    turned = box_on_the_ground() | {
        "inertia": np.array([[1.0, 2.0, 3.0]]),
        "orientation": np.array([[0, 0, half, half]]),
    }
    world = box_on_the_ground() | {"inertia": np.diag([2.0, 1.0, 3.0])[None]}
    np.testing.assert_allclose(
        problem_of_arrays(turned, Repair()).delassus().toarray(),
        problem_of_arrays(world, Repair()).delassus().toarray(),
        atol=1e-14,
    )


def test_the_impulses_of_an_engine_are_judged(tmp_path: Path) -> None:
    arrays = box_on_the_ground()
    right = np.zeros((4, 3))
    right[:, 0] = 2.0 * 10.0 * STEP / 4.0
    np.savez(tmp_path / "right.npz", **arrays, impulses=right)
    assert load(tmp_path / "right.npz").provenance["stored_solution_residual"] <= 1e-15
    assert load(tmp_path / "right.npz").answer is not None
    np.savez(tmp_path / "wrong.npz", **arrays, impulses=0.5 * right)
    assert load(tmp_path / "wrong.npz").provenance["stored_solution_residual"] > 1e-2
    assert load(tmp_path / "wrong.npz").answer is None


def test_json_and_npz_are_the_same_problem(tmp_path: Path) -> None:
    arrays = box_on_the_ground(velocity=(0.1, 0.2, 0.3))
    np.savez(tmp_path / "step.npz", **arrays)
    (tmp_path / "step.json").write_text(json.dumps({name: np.asarray(a).tolist() for name, a in arrays.items()}))
    assert load(tmp_path / "step.json").digest == load(tmp_path / "step.npz").digest
    assert load(tmp_path / "step.json").name == "step"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": np.array([0.0])}, r"mass\[0\] = 0.0 must be positive; for a fixed body"),
        ({"body_2": np.full(4, 1)}, r"body_2\[0\] = 1 must be a body from 0 to 0, or -1"),
        ({"body_1": np.zeros(4, int)}, "contact 0 has body 0 on both sides; 'body_1' and 'body_2' must differ"),
        ({"body_2": np.zeros(4)}, "'body_2' must be a vector of whole numbers"),
        ({"normal": np.full((4, 3), 1.0)}, r"normal\[0\] = .* must be a unit vector"),
        ({"point": np.zeros((3, 3))}, r"'point' must be numbers of shape \(4, 3\)"),
        ({"velocity": np.full((1, 3), np.nan)}, "'velocity' must be finite"),
        ({"time_step": np.array(0.0)}, "'time_step' = 0.0 must be positive"),
        ({"inertia": np.array([[1.0, 1.0, -1.0]])}, "M must be positive definite"),
        ({"mu": None}, "there is no array 'mu'; add it"),
        ({"frictions": np.array(0.5)}, "there is an unknown array 'frictions'"),
        ({"version": np.array(2)}, "'version' must be a whole number up to 1"),
        ({"impulses": np.zeros((4, 2))}, "'impulses' must be 12 finite numbers"),
    ],
)
def test_inconsistent_input_gets_one_sentence(changes: dict[str, Any], words: str) -> None:
    arrays = {name: value for name, value in (box_on_the_ground() | changes).items() if value is not None}
    with pytest.raises(ProblemError, match=words):
        problem_of_arrays(arrays, Repair())


def test_a_step_without_contacts_is_refused(tmp_path: Path) -> None:
    vectors = {name: np.zeros((0, 3)) for name in ("point", "normal")}
    bodies = {name: np.zeros(0, dtype=int) for name in ("body_1", "body_2")}
    np.savez(tmp_path / "step.npz", **(box_on_the_ground() | vectors | bodies))
    with pytest.raises(ProblemError, match=r"step.npz: there are no contacts, so there is nothing to solve"):
        load(tmp_path / "step.npz")
