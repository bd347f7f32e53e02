"""The code of the pages about other programs runs in these programs, and its files contain their steps."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.exchange.formats.kamino import problem_of_arrays
from proxbench.problems.exchange.repair import Repair
from proxbench.solvers import solve

HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how-to"
PAGES = "\n".join((HOW_TO / name).read_text("utf-8") for name in ("export-from-engines.md", "read-other-programs.md"))
HALF = 0.1
"""Half the edge of a cube [m]."""
MASSES = (1.0, 10.0, 100.0)
"""Masses of the stacked cubes, from the lowest one up [kg]."""
GRAVITY = 9.81


def run_writer(program: str, **names: Any) -> None:
    """Execute the code of a section with the variables ``names``; it writes its file into the current folder."""
    section = re.search(rf"^## {program}\n(.*?)(?=^## |\Z)", PAGES, re.DOTALL | re.MULTILINE)
    assert section is not None
    (block,) = re.findall(r"^```python\n(.*?)^```$", section[1], re.DOTALL | re.MULTILINE)
    exec(compile(block, f"section {program}", "exec"), {"numpy": np, **names})


def velocity_after(problem: ContactProblem, impulses: np.ndarray) -> np.ndarray:
    """Return u_f + M⁻¹ W Λ, shape (n_dofs,)."""
    factors = problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    return np.asarray(factors.free_motion + factors.inverse_mass.times(factors.force_directions @ impulses))


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def bullet_stack() -> tuple[Any, list[int]]:
    """Return a client of PyBullet and the stacked cubes in it, before their second step."""
    bullet = pytest.importorskip("pybullet", reason="the extra engines is not installed")
    from pybullet_utils.bullet_client import BulletClient

    client = BulletClient(connection_mode=bullet.DIRECT)
    client.setGravity(0, 0, -GRAVITY)
    client.setPhysicsEngineParameter(fixedTimeStep=0.005, numSolverIterations=50, solverResidualThreshold=0)
    plane = client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=3 * [HALF])
    poses = [[0, 0, HALF * (2 * k + 1)] for k in range(len(MASSES))]
    bodies = [client.createMultiBody(m, shape, basePosition=at) for m, at in zip(MASSES, poses, strict=True)]
    for body in (plane, *bodies):
        client.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
    client.stepSimulation()
    return client, bodies


def test_impulses_of_pybullet_give_its_velocity_after_the_step() -> None:
    client, bodies = bullet_stack()
    run_writer("PyBullet", pybullet=client, bodies=bodies)
    after = np.hstack([np.hstack(client.getBaseVelocity(body)) for body in bodies])
    with np.load("step.npz") as arrays:
        found = velocity_after(load("step.npz"), arrays["impulses"].ravel())
    assert np.abs(found - after).max() <= 1e-13
    assert np.abs(after).max() > 0.05


def test_impulses_of_pybullet_are_judged_and_robust_solves_the_problem() -> None:
    client, bodies = bullet_stack()
    run_writer("PyBullet", pybullet=client, bodies=bodies)
    problem = load("step.npz")
    assert problem.provenance["stored_solution_residual"] == pytest.approx(0.63, abs=0.01)
    assert judge(problem, solve(problem, "Robust", tolerance=1e-8).impulses).residual <= 1e-8


def rapier_world() -> Any:
    rapier = pytest.importorskip("rapier3d", reason="the extra engines is not installed")
    world = rapier.PhysicsWorld(gravity=(0.0, 0.0, -GRAVITY))
    world.set_num_threads(1)
    world.integration_parameters.dt = 0.002
    world.add_collider(rapier.Collider.halfspace((0.0, 0.0, 1.0)).friction(0.5), None)
    return world


def add_rapier_cube(world: Any, mass: float, position: tuple[float, float, float], speed: float = 0.0) -> Any:
    rapier = pytest.importorskip("rapier3d")
    body = rapier.RigidBody.dynamic().translation(position).linvel((speed, 0.0, 0.0)).can_sleep(False)
    handle = world.add_body(body.build())
    world.add_collider(rapier.Collider.cuboid(*3 * [HALF]).mass(mass).friction(0.3).restitution(0.0), handle)
    return handle


def test_a_solved_step_of_rapier_slows_a_sliding_cube_as_rapier_does() -> None:
    """The mean of the coefficients 0.5 and 0.3 determines the deceleration."""
    world = rapier_world()
    cube = add_rapier_cube(world, 8.0, (0.0, 0.0, HALF), speed=2.0)
    for _ in range(20):
        world.step()
    before = world.rigid_bodies.get(cube).linvel.x
    run_writer("Rapier", world=world, bodies=[cube])
    problem = load("step.npz")
    predicted = velocity_after(problem, solve(problem, tolerance=1e-8).impulses)
    lost = 0.4 * GRAVITY * 0.002
    assert before - predicted[0] == pytest.approx(lost, rel=0.01)
    assert before - world.rigid_bodies.get(cube).linvel.x == pytest.approx(before - predicted[0], rel=0.01)
    assert "stored_solution_residual" not in problem.provenance  # the default model reports no friction impulses


@pytest.mark.parametrize(
    ("masses", "speed", "turning"), [((8.0,), 0.5, 3.0), (MASSES, 0.3, 0.0)], ids=["turning cube", "stack"]
)
def test_impulses_of_rapier_give_its_velocity_after_the_step(
    masses: tuple[float, ...], speed: float, turning: float
) -> None:
    """The friction impulses of the model COULOMB act along directions that follow from the normal."""
    world = rapier_world()
    world.integration_parameters.friction_model = pytest.importorskip("rapier3d").FrictionModel.COULOMB
    places = [(0.0, 0.0, HALF * (2 * k + 1)) for k in range(len(masses))]
    bodies = [add_rapier_cube(world, mass, place, speed) for mass, place in zip(masses, places, strict=True)]
    world.rigid_bodies.get(bodies[0]).angvel = (0.0, 0.0, turning)
    for _ in range(20):
        world.step()
    run_writer("Rapier", world=world, bodies=bodies)
    problem = load("step.npz")
    own = [world.rigid_bodies.get(body) for body in bodies]
    after = np.hstack([[*body.linvel, *body.angvel] for body in own])
    with np.load("step.npz") as arrays:
        impulses = arrays["impulses"].ravel()
    assert np.abs(impulses.reshape(-1, 3)[:, 1:]).max() > 0.01
    errors = np.abs(velocity_after(problem, impulses) - after).reshape(-1, 6)
    assert errors[:, :3].max() <= 1e-5
    assert len(bodies) > 1 or errors.max() <= 1e-5  # Rapier does not report the contact points of a stack that turns
    assert np.abs(velocity_after(problem, 0.0 * impulses) - after).max() > 0.01
    assert float(problem.provenance["stored_solution_residual"]) > 1e-4


@pytest.mark.parametrize("normal", [(0.6, 0.0, 0.8), (0.0, -0.6, -0.8), (1.0, 0.0, 0.0), (-1.0, 0.0, -0.0)])
def test_impulses_of_rapier_are_read_for_inclined_normals(normal: tuple[float, float, float]) -> None:
    """A ball slides along a plane; its velocity after the step includes friction in both tangential directions."""
    rapier = pytest.importorskip("rapier3d", reason="the extra engines is not installed")
    world = rapier.PhysicsWorld(gravity=tuple(-GRAVITY * np.array(normal)))
    world.set_num_threads(1)
    world.integration_parameters.dt = 0.002
    world.integration_parameters.friction_model = rapier.FrictionModel.COULOMB
    world.add_collider(rapier.Collider.halfspace(normal).friction(0.5), None)
    velocity = np.array([0.4, 0.5, -0.6])
    velocity -= (velocity @ normal + 0.1) * np.array(normal)
    ball = rapier.RigidBody.dynamic().translation(tuple(HALF * np.array(normal))).linvel(tuple(velocity))
    handle = world.add_body(ball.can_sleep(False).build())
    world.add_collider(rapier.Collider.ball(HALF).mass(2.0).friction(0.5).restitution(0.0), handle)
    world.step()
    run_writer("Rapier", world=world, bodies=[handle])
    body = world.rigid_bodies.get(handle)
    with np.load("step.npz") as arrays:
        impulses = arrays["impulses"].ravel()
    assert np.abs(impulses[1:]).min() > 1e-4
    found = velocity_after(load("step.npz"), impulses)
    assert np.abs(found - [*body.linvel, *body.angvel]).max() <= 1e-5


def test_contacts_of_rapier_are_where_its_cubes_touch() -> None:
    world = rapier_world()
    places = [(0.03 * k, 0.02 * k, HALF * (2 * k + 1)) for k in range(len(MASSES))]
    cubes = [add_rapier_cube(world, mass, place) for mass, place in zip(MASSES, places, strict=True)]
    run_writer("Rapier", world=world, bodies=cubes)
    with np.load("step.npz") as arrays:
        below, above = arrays["body_1"], arrays["body_2"]
        assert sorted(zip(below.tolist(), above.tolist(), strict=True)) == 4 * [(-1, 0)] + 4 * [(0, 1)] + 4 * [(1, 2)]
        assert arrays["normal"] == pytest.approx(np.tile([0.0, 0.0, 1.0], (12, 1)), abs=1e-6)
        assert arrays["point"][:, 2] == pytest.approx(2 * HALF * above, abs=1e-6)
        for bodies in (below, above):
            corners = np.abs(arrays["point"] - arrays["position"][bodies])[bodies >= 0, :2]
            assert corners.max() == pytest.approx(HALF, abs=1e-6)
        expected = np.outer(arrays["mass"] * (2 * HALF) ** 2 / 6, np.ones(3))
        assert arrays["inertia"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("is_compliant", [False, True])
def test_a_dump_of_kamino_has_its_velocity_and_a_small_residual(is_compliant: bool) -> None:
    """The first compilation of Kamino's kernels takes minutes; Warp caches them."""
    newton = pytest.importorskip("newton", reason="the extra kamino is not installed")
    import warp

    builder = newton.ModelBuilder()
    newton.solvers.SolverKamino.register_custom_attributes(builder)
    builder.add_ground_plane()
    body = builder.add_body(xform=warp.transform((0, 0, HALF), warp.quat_identity()))
    builder.add_shape_box(body, hx=HALF, hy=HALF, hz=HALF)
    model = builder.finalize(device="cpu")
    config = newton.solvers.SolverKamino.Config()
    config.constraints.contact_compliance = is_compliant
    solver, pipeline = newton.solvers.SolverKamino(model, config=config), newton.CollisionPipeline(model)
    state = model.state()
    contacts = pipeline.contacts()
    pipeline.collide(state, contacts)
    inner = solver._solver_kamino._solver_fd
    replaced = inner.solve

    def write_and_solve(problem: Any) -> None:
        run_writer("Kamino", problem=problem)
        replaced(problem)

    inner.solve = write_and_solve
    solver.step(state, model.state(), model.control(), contacts, 0.002)
    with np.load("kamino.npz") as arrays:
        found = dict(arrays)
    rows, solution = found["v_f"].size, inner.data.solution
    found |= {name: getattr(solution, name).numpy()[:rows] for name in ("lambdas", "v_plus")}
    problem = problem_of_arrays(found, Repair(indefinite="project"))  # refuses a v_plus other than D λ + v_f
    assert problem.n_contacts == 4
    assert (problem.engine is not None) == is_compliant
    own = "stored_solution_own_residual" if is_compliant else "stored_solution_residual"
    assert problem.provenance[own] < 1e-3
    assert not is_compliant or problem.provenance["stored_solution_residual"] > 1e-2
    assert judge(problem, solve(problem, tolerance=1e-6).impulses).residual <= 1e-6


def dropped_box(pin: Any) -> SimpleNamespace:
    """Return a tilted box of Pinocchio that falls onto the ground, with a contact at each lower corner."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    model.appendBodyToJoint(joint, pin.Inertia.FromBox(2.0, *3 * [2 * HALF]), pin.SE3.Identity())
    q, v = pin.neutral(model), np.array([0.3, 0.1, -0.5, 0.1, 0.2, 0.3])
    q[2:3], q[3:7] = HALF + 0.001, pin.Quaternion(pin.rpy.rpyToMatrix(0.004, 0.002, 0.3)).coeffs()
    corners = [(joint, np.array([x, y, -HALF])) for x in (-HALF, HALF) for y in (-HALF, HALF)]
    return SimpleNamespace(model=model, q=q, v=v, corners=corners, ground=0.0)


def humanoid(pin: Any) -> SimpleNamespace:
    """Return Pinocchio's humanoid, which bends its knees and lands on both feet, with four contacts at each."""
    model = pin.buildSampleModelHumanoid()
    q = pin.neutral(model)
    for side in ("rleg", "lleg"):
        for joint, angle in (("shoulder2", -0.4), ("elbow", 0.8), ("wrist1", -0.4)):
            q[model.joints[model.getJointId(f"{side}_{joint}_joint")].idx_q] = angle
    v = 0.1 * np.random.default_rng(0).standard_normal(model.nv)
    v[2] -= 1.0
    feet = [model.getJointId(f"{side}_wrist2_joint") for side in ("rleg", "lleg")]
    corners = [(foot, np.array([x, y, -0.1])) for foot in feet for x in (-0.1, 0.2) for y in (-0.05, 0.05)]
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    ground = min(data.oMi[foot].act(point)[2] for foot, point in corners)
    return SimpleNamespace(model=model, q=q, v=v, corners=corners, ground=ground)


@pytest.fixture(params=[dropped_box, humanoid], ids=lambda made: made.__name__)
def posed(request: pytest.FixtureRequest) -> SimpleNamespace:
    """Return a model of Pinocchio at q and v, and the problem that the writer gives for it."""
    pin = pytest.importorskip("pinocchio", reason="the extra peers is not installed")
    found: SimpleNamespace = request.param(pin)
    found.pin, found.torque = pin, np.zeros(found.model.nv)
    data = found.model.createData()
    pin.forwardKinematics(found.model, data, found.q)
    found.points, found.contacts = [], pin.StdVec_ConstraintModel()
    for joint, local in found.corners:
        point = data.oMi[joint].act(local)
        on_ground = pin.SE3(np.eye(3), np.array([point[0], point[1], found.ground]))
        contact = pin.PointContactConstraintModel(found.model, 0, on_ground, joint, pin.SE3(np.eye(3), local))
        contact.setFriction(0.5)
        found.contacts.append(pin.ConstraintModel(contact))
        found.points.append(point)
    names = {name: getattr(found, name) for name in ("model", "q", "v", "torque", "contacts")}
    run_writer("Pinocchio", pinocchio=pin, **names)
    found.problem = load("step.npz")
    found.impulses = solve(found.problem, "Robust", tolerance=1e-9).impulses
    return found


def test_the_matrix_of_a_pinocchio_model_is_that_of_its_cholesky_decomposition(posed: SimpleNamespace) -> None:
    pin, model, contacts = posed.pin, posed.model, posed.contacts
    data, datas = model.createData(), pin.StdVec_ConstraintData()
    pin.computeAllTerms(model, data, posed.q, posed.v)
    for contact in contacts:
        datas.append(contact.createData())
        contact.calc(model, data, datas[-1])
    cholesky = pin.ConstraintCholeskyDecomposition(model, data, contacts, datas)
    damping = 1e-9
    cholesky.compute(model, data, contacts, datas, damping)
    expected = cholesky.getInverseOperationalSpaceInertiaMatrix() - damping * np.eye(3 * len(contacts))
    order = np.arange(3 * len(contacts)).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    assert np.abs(posed.problem.delassus().toarray() - expected[order][:, order]).max() <= 1e-9 * expected.max()


def test_solved_impulses_move_a_pinocchio_model_as_external_forces_do(posed: SimpleNamespace) -> None:
    """The final velocity follows from forces in world axes at the corners and ``aba``, which ignores constraints."""
    pin, model, step = posed.pin, posed.model, 0.001
    data = model.createData()
    pin.forwardKinematics(model, data, posed.q)
    forces = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    by_contact = posed.impulses.reshape(-1, 3)
    for (joint, local), (normal, *tangential) in zip(posed.corners, by_contact, strict=True):
        force = data.oMi[joint].rotation.T @ np.array([*tangential, normal]) / step
        forces[joint] = forces[joint] + pin.Force(force, np.cross(local, force))
    after = posed.v + step * pin.aba(model, data, posed.q, posed.v, posed.torque, forces)
    pin.forwardKinematics(model, data, posed.q, after)
    moved = [data.oMi[joint].rotation @ at for joint, at in velocities(posed, data)]
    gaps = np.array([point[2] - posed.ground for point in posed.points])
    expected = np.array(moved)[:, [2, 0, 1]]
    expected[:, 0] += np.maximum(gaps, 0.0) / step
    found = posed.problem.relative_velocity(posed.impulses).reshape(-1, 3)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(posed.v).max()
    assert by_contact[:, 0].max() > 0.0


def velocities(posed: SimpleNamespace, data: Any) -> list[tuple[int, np.ndarray]]:
    """Return the joint of each corner and the corner's velocity in axes of the joint."""
    return [(joint, data.v[joint].linear + np.cross(data.v[joint].angular, local)) for joint, local in posed.corners]


def test_the_solution_of_a_pinocchio_model_is_judged_solved(posed: SimpleNamespace) -> None:
    assert judge(posed.problem, posed.impulses).residual <= 1e-9
    assert posed.problem.n_contacts == len(posed.corners)
