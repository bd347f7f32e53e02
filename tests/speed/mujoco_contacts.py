"""Tables of MuJoCo's contacts: the rise of a thrown cube by integrator and ``impratio``, and PGS on elliptic cones.

``python tests/speed/mujoco_contacts.py lifts cones`` prints numbers of docs/results-engines.md. It needs the extra
``mujoco``.

*lifts* throws a cube along a floor for 0.6 s, with MuJoCo's forces and with those of Robust under Coulomb's law.
*cones* lets a block of 54 spheres with random velocities fall into a box, by Newton steps. In the steps 0 and 100 of
this motion, each solver runs at a tolerance of 0 for up to 10 000 iterations.
"""

import argparse
import copy
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
from captured_models import CUBE
from proxbench.problems import from_mujoco
from proxbench.problems.capture.step import EmptyStepError, captured_step, judge_step
from proxbench.solvers import solve

INTEGRATORS = ("Euler", "implicitfast", "discrete")
IMPRATIOS = (1, 10, 100)
DURATION = 0.6
HALF_EDGE = 0.1

SPHERES = (3, 3, 6)
RADIUS, PITCH = 0.05, 0.098
STEPS = (0, 100)
SOLVERS = (("Newton", "elliptic"), ("CG", "elliptic"), ("PGS", "elliptic"), ("PGS", "pyramidal"))


def lift_rows() -> Iterator[str]:
    """Yield a row of Markdown for each integrator and each kind of forces."""
    yield f"| Forces | {' | '.join(f'`impratio` {ratio}' for ratio in IMPRATIOS)} |"
    yield "| --- " + "| ---: " * len(IMPRATIOS) + "|"
    for name in (*INTEGRATORS, ""):
        heights = []
        for ratio in IMPRATIOS:
            option = f'cone="elliptic" impratio="{ratio}" integrator="{name or "Euler"}"'
            model = mujoco.MjModel.from_xml_string(CUBE.replace('cone="elliptic"', option))
            heights.append(f"{1e3 * lift(model, with_coulomb=not name):.1f} mm")
        yield f"| {f'MuJoCo, {name}' if name else 'Coulomb’s law, by `Robust`'} | {' | '.join(heights)} |"


def lift(model: Any, with_coulomb: bool) -> float:
    """Return how far a thrown cube rises [m], by MuJoCo's forces or under Coulomb's law."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    height = 0.0
    for _ in range(round(DURATION / model.opt.timestep)):
        if not with_coulomb or not move_by_coulomb(model, data):
            mujoco.mj_step(model, data)
        height = max(height, data.qpos[2] - HALF_EDGE)
    return height


def move_by_coulomb(model: Any, data: Any) -> bool:
    """Take a step with contact impulses under Coulomb's law; return whether there is a contact."""
    try:
        problem = from_mujoco(model, data)
    except EmptyStepError:
        return False
    factors = problem.factors
    assert factors is not None
    assert factors.free_motion is not None
    impulses = solve(problem, tolerance=1e-8).impulses
    data.qvel[:] = factors.free_motion + factors.inverse_mass.times(factors.force_directions @ impulses)
    mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)
    data.time += model.opt.timestep
    return True


def spheres() -> Any:
    """Return a model of a block of spheres in a box, which touch each other and the floor at the start."""
    places = np.argwhere(np.ones(SPHERES)) * PITCH - 0.5 * PITCH * (np.array(SPHERES) - 1) * (1, 1, 0)
    bodies = "".join(
        f'<body pos="{x:.6f} {y:.6f} {z + 0.99 * RADIUS:.6f}"><freejoint/><geom size="{RADIUS}" friction="0.5"/></body>'
        for x, y, z in places
    )
    wall, width = 0.02, 0.5 * PITCH * SPHERES[0] + 0.03
    walls = "".join(
        f'<geom type="box" size="{size}" pos="{place}" friction="0.5"/>'
        for size, place in (
            (f"{wall} 1 1", f"{width + wall} 0 1"),
            (f"{wall} 1 1", f"{-width - wall} 0 1"),
            (f"1 {wall} 1", f"0 {width + wall} 1"),
            (f"1 {wall} 1", f"0 {-width - wall} 1"),
        )
    )
    floor = '<geom type="plane" size="5 5 0.1" friction="0.5"/>'
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{floor}{walls}{bodies}</worldbody></mujoco>")


def cone_rows() -> Iterator[str]:
    """Yield a row of Markdown for each solver and cone, with residuals in MuJoCo's own model."""
    yield f"| Solver, cone | {' | '.join(f'step {step}' for step in STEPS)} |"
    yield "| --- " + "| ---: " * len(STEPS) + "|"
    for algorithm, cone in SOLVERS:
        model = spheres()
        model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{cone.upper()}")
        data, residuals = mujoco.MjData(model), []
        data.qvel[:] = np.random.default_rng(0).normal(size=model.nv)
        for step in range(max(STEPS) + 1):
            if step in STEPS:
                residuals.append(f"{own_residual(model, data, algorithm):.2g}")
            mujoco.mj_step(model, data)
        yield f"| {algorithm}, {cone} | {' | '.join(residuals)} |"


def own_residual(model: Any, data: Any, algorithm: str) -> float:
    """Return the residual in MuJoCo's own model of the next step, solved as accurately as the algorithm can."""
    accurate = copy.copy(model)
    accurate.opt.solver = getattr(mujoco.mjtSolver, f"mjSOL_{algorithm.upper()}")
    accurate.opt.tolerance, accurate.opt.iterations = 0.0, 10_000
    own = judge_step(captured_step(accurate, copy.copy(data))).own
    assert own is not None
    return own


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=("lifts", "cones"), help="what to print")
    for table in parser.parse_args(arguments).tables:
        for row in lift_rows() if table == "lifts" else cone_rows():
            print(row, flush=True)


if __name__ == "__main__":
    main()
