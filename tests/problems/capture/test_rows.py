"""Constraint rows become the corresponding laws, or are refused with a reason."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import LawKind, ProblemError, from_mujoco, judge
from proxbench.problems.capture import rows, step
from proxbench.problems.capture.step import captured_step
from proxbench.solvers import solve
from small_models import CUBE, EVERYTHING, STACK, WELDED, moving, refuse_first_rows

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

PLAIN = {"cone": "elliptic", "integrator": "Euler", "solver": "Newton", "jacobian": "auto"}


def sphere(contact: str, option: str = "", floor: str = "") -> tuple[Any, Any]:
    text = f"""<mujoco><option cone="elliptic" {option}/><worldbody>
    <geom type="plane" size="5 5 0.1" {contact} {floor}/>
    <body pos="0 0 0.099"><freejoint/><geom type="sphere" size="0.1" {contact}/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


@pytest.mark.parametrize(
    ("condim", "kinds", "coefficients"),
    [
        (1, [LawKind.UNILATERAL], [0.0]),
        (3, [LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION], [0.0, 0.7]),
        (4, [LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION, LawKind.PLANAR_ROLLING], [0.0, 0.7, 0.01]),
        (6, [LawKind.UNILATERAL, LawKind.SPATIAL_FRICTION, LawKind.ROLLING_AND_SPINNING], [0.0, 0.7, 0.01]),
    ],
)
def test_condim_chooses_the_laws_and_friction_their_coefficients(
    condim: int, kinds: list[LawKind], coefficients: list[float]
) -> None:
    laws = from_mujoco(*sphere(f'condim="{condim}" friction="0.7 0.01 0.002"', 'impratio="9"')).laws
    assert laws.kind.tolist() == kinds
    assert laws.friction_coefficient.tolist() == pytest.approx(coefficients)


def test_friction_that_differs_between_axes_scales_rows_and_keeps_work() -> None:
    text = """<mujoco><option cone="elliptic"/><worldbody><geom name="floor" type="plane" size="5 5 0.1"/>
    <body pos="0 0 0.099"><freejoint/><geom name="ball" type="sphere" size="0.1"/></body></worldbody>
    <contact><pair geom1="floor" geom2="ball" friction="0.8 0.2 0.01 0.001 0.001"/></contact></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qvel[:2] = 1.0
    found = captured_step(model, data)
    assert found.problem.laws.friction_coefficient.tolist() == pytest.approx([0.0, 0.8])
    _, first, second = np.linalg.norm(found.problem.factors.force_directions.toarray()[:3], axis=0)
    assert second / first == pytest.approx(0.25)
    solved = solve(found.problem, tolerance=1e-10).impulses
    force = found.problem.factors.force_directions.toarray()[:3] @ solved
    assert np.linalg.norm([force[0] / 0.8, force[1] / 0.2]) == pytest.approx(force[2]) or np.linalg.norm(
        [force[0] / 0.2, force[1] / 0.8]
    ) == pytest.approx(force[2])


def test_other_rows_become_bilateral_bounded_and_unilateral_laws() -> None:
    model, data = moving(EVERYTHING.format(**PLAIN))
    found = captured_step(model, data)
    laws, keys = found.problem.laws, found.keys
    assert laws.kind[:6].tolist() == [LawKind.BILATERAL] * 6
    assert keys[0] == "equality weld"
    joint, tendon = keys.index("friction of joint hinge"), keys.index("friction of tendon tendon")
    assert laws.fixed_bound[[joint, tendon]] == pytest.approx([0.1 * model.opt.timestep, 0.2 * model.opt.timestep])
    assert laws.partner[[joint, tendon]].tolist() == [-1, -1]
    assert laws.kind[keys.index("limit of joint ball")] == LawKind.UNILATERAL
    assert len(keys) == found.problem.n_contacts


def test_friction_across_the_plane_of_a_planar_model_has_no_row() -> None:
    text = """<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="5 5 0.1"/><body pos="0 0 0.099">
    <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>
    <geom type="sphere" size="0.1"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    assert from_mujoco(model, mujoco.MjData(model)).laws.kind.tolist() == [LawKind.UNILATERAL, LawKind.PLANAR_FRICTION]


def test_a_moving_surface_moves_the_relative_velocity() -> None:
    still = from_mujoco(*sphere("")).free_velocity
    moved = from_mujoco(*sphere("", floor='surfacevel="0.3 0 0 0 0 0"')).free_velocity
    assert np.linalg.norm(moved - still) == pytest.approx(0.3)


def test_a_refused_row_acts_as_the_engine_had_it_act(monkeypatch: pytest.MonkeyPatch) -> None:
    model, data = moving(EVERYTHING.format(**PLAIN))
    whole = captured_step(model, data)
    refuse_first_rows(monkeypatch, 1)
    found = captured_step(model, data)
    assert [(one.row, one.name, one.reason) for one in found.refused] == [(0, "equality weld", rows.IMMOBILE)]
    velocity = found.problem.relative_velocity(found.impulses)
    expected = whole.problem.relative_velocity(whole.impulses)[1:]
    assert velocity == pytest.approx(expected, abs=1e-13)


def test_a_row_of_an_unknown_type_is_refused_with_its_number(monkeypatch: pytest.MonkeyPatch) -> None:
    model, data = moving(EVERYTHING.format(**PLAIN))
    monkeypatch.setattr(rows, "mujoco", lambda: with_other_number("mjCNSTR_LIMIT_JOINT"))
    kind = int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
    reasons = [one.reason for one in captured_step(model, data).refused]
    assert reasons
    assert set(reasons) == {f"its type {kind} is not known; remove it from the model"}


def with_other_number(name: str) -> Any:
    """Return the module mujoco with an unused number for one type of rows."""
    types = {one: getattr(mujoco.mjtConstraint, one) for one in dir(mujoco.mjtConstraint) if one.startswith("mjCNSTR")}
    changed = SimpleNamespace(**(types | {name: 99}))
    return SimpleNamespace(**{one: getattr(mujoco, one) for one in dir(mujoco)} | {"mjtConstraint": changed})


def test_a_step_whose_rows_are_all_refused_names_a_row_and_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_first_rows(monkeypatch)
    sentence = (
        r"none of the 6 constraint rows at 0 s is supported: equality weld is refused because it moves no degree of "
        r"freedom; give one of its bodies a joint, or remove it from the model\.$"
    )
    with pytest.raises(step.EmptyStepError, match=sentence):
        from_mujoco(*moving(WELDED, 0))


def test_the_thrown_cube_solves_its_own_model_and_separates_from_the_floor() -> None:
    model = mujoco.MjModel.from_xml_string(CUBE)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data)
    found = captured_step(model, data)
    verdict = step.judge_step(found)
    assert verdict.own < 1e-13
    assert verdict.separation > 0.4
    assert verdict.coulomb == pytest.approx(verdict.separation / 6.0, rel=0.1)
    ours = solve(found.problem, tolerance=1e-8).impulses
    assert judge(found.problem, ours).residual < 1e-8


def lift(model: Any, with_coulomb: bool) -> float:
    """Return how far a thrown cube rises [m], by MuJoCo's forces or under Coulomb's law."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    height = 0.0
    for _ in range(200):
        try:
            if not with_coulomb:
                raise step.EmptyStepError
            problem = from_mujoco(model, data)
            impulses = solve(problem, tolerance=1e-8).impulses
            factors = problem.factors
            data.qvel[:] = factors.free_motion + factors.inverse_mass.times(factors.force_directions @ impulses)
            mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)
        except step.EmptyStepError:
            mujoco.mj_step(model, data)
        height = max(height, data.qpos[2] - 0.1)
    return height


def test_the_thrown_cube_lifts_in_mujoco_and_stays_down_under_coulombs_law() -> None:
    model = mujoco.MjModel.from_xml_string(CUBE)
    assert lift(model, with_coulomb=False) > 0.01
    assert lift(model, with_coulomb=True) < 1e-6


@pytest.mark.parametrize(
    ("option", "sentence"),
    [
        ('integrator="RK4"', 'the integrator RK4 solves the constraints four times in a step; set integrator to "impl'),
        ('integrator="implicit"', "the integrator IMPLICIT has a mass matrix that is not symmetric"),
    ],
)
def test_an_integrator_without_a_contact_problem_is_refused(option: str, sentence: str) -> None:
    with pytest.raises(ProblemError, match=sentence):
        from_mujoco(*sphere("", option))


def test_a_step_without_contact_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string(CUBE)
    with pytest.raises(ProblemError, match="the step at 0 s has no contact and no other constraint; capture a later"):
        from_mujoco(model, mujoco.MjData(model))


def test_data_of_another_model_are_refused() -> None:
    model, _ = sphere("")
    other = mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))
    with pytest.raises(ProblemError, match=r"the data belong to another model; pass mujoco\.MjData\(model\)"):
        from_mujoco(model, other)


def test_a_step_that_ends_in_another_velocity_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model, data = moving(STACK.format(**PLAIN))
    monkeypatch.setattr(step, "_unbalanced", lambda inverse, data, total: 0.01 * total)
    with pytest.raises(ProblemError, match=r"differs by a relative \d\.\de-\d+ from the velocity of its forces"):
        from_mujoco(model, data)
    monkeypatch.setattr(step, "STEP_ERROR", 1.0)
    found = captured_step(model, data)
    factors = found.problem.factors
    kick = factors.inverse_mass.times(factors.force_directions @ found.impulses)
    velocities = [data.qvel, factors.free_motion, factors.free_motion + kick, factors.free_motion + 1.01 * kick]
    error = 0.01 * np.abs(kick).max() / np.abs(velocities).max()
    assert found.problem.provenance["velocity_error"] == pytest.approx(error, rel=1e-6)


@pytest.mark.parametrize(
    ("after", "free", "error"), [(0.0, 0.0, 0.0), (2.0, 0.0, 0.5), (2.0, 4.0, 0.25), (np.nan, 0.0, np.nan)]
)
def test_the_error_of_the_velocity_is_relative_to_the_largest_velocity(after: float, free: float, error: float) -> None:
    expected, ends = np.array([0.0, after / 2]), (np.array([0.0, after]), np.zeros(2))
    assert step._velocity_error(expected, *ends, np.array([free, 0.0])) == pytest.approx(error, nan_ok=True)
