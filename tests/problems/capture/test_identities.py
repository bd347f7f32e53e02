"""Identities between a captured problem and MuJoCo: A, b, forces on coordinates, and the velocity after the step."""

import copy
from itertools import product
from typing import Any

import numpy as np
import pytest
from proxbench.problems.capture.step import captured_step, judge_step
from small_models import EVERYTHING, STACK, moving

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

INTEGRATORS, CONES = ("Euler", "implicitfast", "discrete"), ("elliptic", "pyramidal")


def stepped(model: Any, data: Any) -> Any:
    after = copy.copy(data)
    mujoco.mj_step(model, after)
    return after


def relative(error: Any, scale: Any) -> float:
    return float(np.abs(error).max() / np.abs(scale).max())


@pytest.fixture(params=list(product(("stack", "everything"), INTEGRATORS, CONES)), ids="-".join)
def moved(request: pytest.FixtureRequest) -> tuple[Any, Any]:
    name, integrator, cone = request.param
    text = {"stack": STACK, "everything": EVERYTHING}[name]
    return moving(text.format(cone=cone, integrator=integrator, solver="Newton", jacobian="auto"))


def test_the_velocity_after_the_step_is_that_of_the_impulses(moved: tuple[Any, Any]) -> None:
    model, data = moved
    step, after = captured_step(model, data), stepped(model, data)
    directions = step.problem.factors.force_directions
    velocity = step.problem.relative_velocity(step.impulses)
    assert relative(directions.T @ after.qvel - velocity, step.problem.free_velocity) < 1e-12


def test_the_error_of_the_velocity_in_the_provenance_is_rounding(moved: tuple[Any, Any]) -> None:
    assert captured_step(*moved).problem.provenance["velocity_error"] < 1e-12


def test_a_stack_at_rest_is_captured() -> None:
    """Its velocities are rounding errors of terms that cancel."""
    text = STACK.format(cone="elliptic", integrator="Euler", solver="Newton")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1500)
    assert np.abs(data.qvel).max() < 1e-8
    assert captured_step(model, data).problem.provenance["velocity_error"] < 1e-12


def test_impulses_give_the_generalised_constraint_forces_of_mujoco(moved: tuple[Any, Any]) -> None:
    model, data = moved
    step, after = captured_step(model, data), stepped(model, data)
    force = step.problem.factors.force_directions @ step.impulses / model.opt.timestep
    assert relative(force - after.qfrc_constraint, after.qfrc_constraint) < 1e-12


def test_b_is_the_acceleration_without_constraints_less_the_reference(moved: tuple[Any, Any]) -> None:
    model, data = moved
    assert relative(captured_step(model, data).engine.offset - stepped(model, data).efc_b, 1.0) < 1e-12


def test_the_solver_solves_its_own_model_and_not_coulombs_law(moved: tuple[Any, Any]) -> None:
    verdict = judge_step(captured_step(*moved))
    assert verdict.own < 1e-11
    assert verdict.coulomb > 1e-5


@pytest.mark.parametrize(("integrator", "cone"), list(product(INTEGRATORS, CONES)))
def test_a_plus_r_is_the_matrix_of_mujocos_pgs(integrator: str, cone: str) -> None:
    model, data = moving(STACK.format(cone=cone, integrator=integrator, solver="PGS"))
    engine, after = captured_step(model, data).engine, stepped(model, data)
    dense = engine.matrix.toarray() + np.diag(engine.regularisation)
    assert relative(dense - after.efc_AR.reshape(dense.shape), dense) < 1e-12


def test_a_dense_and_a_sparse_jacobian_give_the_same_problem() -> None:
    problems = []
    for jacobian in ("dense", "sparse"):
        text = EVERYTHING.format(cone="elliptic", integrator="Euler", solver="Newton", jacobian=jacobian)
        problems.append(captured_step(*moving(text, 20)).problem)
    one, other = (problem.delassus().toarray() for problem in problems)
    assert relative(one - other, one) < 1e-12


def test_capturing_does_not_modify_the_state() -> None:
    model, data = moving(STACK.format(cone="elliptic", integrator="Euler", solver="Newton"))
    before = copy.copy(data)
    captured_step(model, data)
    assert np.array_equal(before.qpos, data.qpos)
    assert np.array_equal(before.efc_force, data.efc_force)
    assert before.time == data.time


def test_both_cones_give_one_contact_problem() -> None:
    """Combinations of the rows of a pyramid are the rows of the contact's frame."""
    model, data = moving(EVERYTHING.format(cone="elliptic", integrator="Euler", solver="Newton", jacobian="auto"))
    elliptic = captured_step(model, data).problem
    model.opt.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    pyramid = captured_step(model, data).problem
    assert np.array_equal(elliptic.laws.kind, pyramid.laws.kind)
    assert np.allclose(elliptic.laws.friction_coefficient, pyramid.laws.friction_coefficient, rtol=1e-15)
    assert relative((elliptic.delassus() - pyramid.delassus()).toarray(), elliptic.delassus().data) < 1e-12
