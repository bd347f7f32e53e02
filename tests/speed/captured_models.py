"""Tables of captured models of MuJoCo: identities and both residuals of each model, and solvers on the same steps.

``python tests/speed/captured_models.py models`` prints a row for each model of docs/results-engines.md. ``solvers``
prints MuJoCo's solvers and Robust on the captured steps of three models, and ``thrown`` the residuals of the thrown
cube in its first step in contact. All need the extra ``mujoco``. The models of
dm_control are read from its wheel, ``pip install --no-deps dm_control==1.0.50``, or from the folder ``--suite``, and
are left out if there is none.

The identities of a step: A + R is the matrix of MuJoCo's PGS, b is MuJoCo's own, and the impulses give the velocity
after the step. The program ends with an error if one of them is off by more than 1e-12, relative to its terms.
"""

import argparse
import copy
import gc
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import scipy.sparse as sp
from proxbench.problems import ContactProblem, Model, judge
from proxbench.problems.capture.sequence import CaptureOptions, captured_steps
from proxbench.problems.capture.step import VELOCITY_ERROR, CapturedStep, judge_step
from proxbench.problems.contact.residual import Residual
from proxbench.solvers import Stop, create
from proxbench.solvers.peers.mujoco_problem import ConstraintStage
from proxbench.solvers.peers.mujoco_program import program_of
from threadpoolctl import threadpool_limits

IDENTITY_ERROR = 1e-12

CUBE = """
<mujoco><option cone="elliptic"/><worldbody>
  <geom type="plane" size="10 10 0.1" friction="0.5"/>
  <body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" friction="0.5"/></body>
</worldbody><keyframe><key name="thrown" qvel="6 0 0 0 0 0"/></keyframe></mujoco>"""

BOXES = """
<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="5 5 0.1" friction="0.5"/>
<body pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1" friction="0.5"/></body>
<body pos="0 0 0.3"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="10" friction="0.5"/></body>
<body pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="100" friction="0.5"/></body>
</worldbody></mujoco>"""

RANDOM_CONTROLS = CaptureOptions(duration=2.0, every=10, seed=0)

ALGORITHMS = ("Newton", "CG", "PGS")

TOLERANCE, ITERATIONS = 1e-8, 100
"""MuJoCo's defaults, and the tolerance of Robust."""

COMPARED = ("thrown cube, 6 m/s, μ = 0.5", "three boxes, 1:10:100", "humanoid")


@dataclass(frozen=True)
class Captured:
    """A captured step.

    Attributes:
        step: the step.
        errors: relative errors of A + R, b, and the velocity after the step.
    """

    step: CapturedStep
    errors: tuple[float, float, float]


def suite_folder() -> Path | None:
    """Return the folder of the models of dm_control, without importing it; None if it is not installed."""
    found = find_spec("dm_control")
    folders = [] if found is None else list(found.submodule_search_locations or [])
    return Path(folders[0]) / "suite" if folders else None


def models(suite: Path | None) -> Iterator[tuple[str, Any, CaptureOptions, str]]:
    """Yield name, model, options of the capture and keyframe of each model."""
    yield COMPARED[0], mujoco.MjModel.from_xml_string(CUBE), CaptureOptions(0.5, 1), "thrown"
    yield COMPARED[1], mujoco.MjModel.from_xml_string(BOXES), CaptureOptions(1.0, 10), ""
    for name in ("humanoid", "quadruped", "dog", "stacker", "manipulator", "walker"):
        if suite is not None:
            yield name, mujoco.MjModel.from_xml_path(str(suite / f"{name}.xml")), RANDOM_CONTROLS, ""


def captured(model: Any, options: CaptureOptions, keyframe: str = "") -> Iterator[Captured]:
    """Yield each captured step of a motion that has a constraint, with the errors of its identities."""
    data = mujoco.MjData(model)
    if keyframe:
        mujoco.mj_resetDataKeyframe(model, data, mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, keyframe))
    for step in captured_steps(model, data, options, "model"):
        if isinstance(step, CapturedStep):
            yield Captured(step, identity_errors(model, data, step))


def identity_errors(model: Any, data: Any, step: CapturedStep) -> tuple[float, float, float]:
    """Return the errors of A + R, b, and the velocity after the step, relative to the largest terms of each.

    ``data`` has the state before the step.
    """
    usual, after = model.opt.solver, copy.copy(data)
    model.opt.solver = mujoco.mjtSolver.mjSOL_PGS  # only PGS forms its matrix
    mujoco.mj_forward(model, after)
    model.opt.solver = usual
    engine = step.engine
    ours = engine.matrix.toarray() + np.diag(engine.regularisation)
    size = len(ours)
    if mujoco.mj_isSparse(model):
        starts = np.append(after.efc_AR_rowadr, after.efc_AR_rowadr[-1] + after.efc_AR_rownnz[-1])
        parts = after.efc_AR[: starts[-1]], after.efc_AR_colind[: starts[-1]], starts
        theirs = sp.csr_array(parts, shape=(size, size)).toarray()
    else:
        theirs = after.efc_AR.reshape(size, size)
    offset = np.abs(engine.offset - after.efc_b).max() / (engine.scale or 1.0)
    velocity = float(step.problem.provenance[VELOCITY_ERROR])
    return float(np.abs(ours - theirs).max() / np.abs(ours).max()), float(offset), velocity


def model_rows(suite: Path | None) -> Iterator[str]:
    """Yield a row of Markdown for each model, with medians and 90 % quantiles over its steps."""
    yield "| Model | Steps | Rows | Own model | Coulomb | Separation [m/s] | A + R | b | Velocity |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for name, model, options, keyframe in models(suite):
        found = list(captured(model, options, keyframe))
        errors = np.max([one.errors for one in found], axis=0)
        verdicts = [judge_step(one.step) for one in found]
        tracks = [[getattr(one, track) for one in verdicts] for track in ("own", "coulomb", "separation")]
        cells = [f"{np.median(values):.1e}, {np.quantile(values, 0.9):.1e}" for values in tracks]
        rows = sum(len(one.step.forces) for one in found)
        refused = sum(len(one.step.refused) for one in found)
        counts = f"{len(found)} | {rows}" + (f" ({refused} refused)" if refused else "")
        yield f"| {name} | {counts} | {' | '.join([*cells, *(f'{error:.0e}' for error in errors)])} |"
        if not errors.max() <= IDENTITY_ERROR:
            raise SystemExit(f"an identity of {name} is off by {errors.max():.1e}")


class Stage:
    """A solver of MuJoCo on a captured step: only ``mj_fwdConstraint`` is timed."""

    def __init__(self, problem: ContactProblem, algorithm: str) -> None:
        self.stage, self.zeros = ConstraintStage(program_of(problem, 0.95), algorithm), np.zeros(problem.n_rows)

    def begin(self) -> None:
        """Start from the free motion."""
        self.stage.start(self.zeros)

    def solve(self) -> None:
        """Solve."""
        self.stage.run(TOLERANCE, ITERATIONS)

    def impulses(self) -> np.ndarray:
        """Return the impulses of the last solve [N s]."""
        return self.stage.impulses


class RobustSolve:
    """Robust on a captured step, under Coulomb's law; only ``solve`` of the prepared problem is timed."""

    def __init__(self, problem: ContactProblem) -> None:
        self.prepared = create("Robust").prepare(problem)

    def begin(self) -> None:
        """Do nothing: each solve starts from zero."""

    def solve(self) -> None:
        """Solve."""
        self.found = self.prepared.solve(Stop(TOLERANCE, 10_000, 10.0))

    def impulses(self) -> np.ndarray:
        """Return the impulses of the last solve [N s]."""
        return self.found.impulses


def solver_rows(suite: Path | None, rounds: int) -> Iterator[str]:
    """Yield a row of Markdown for each solver on the steps of each model."""
    yield "| Model | Solver | Own model | Coulomb | Time [µs] |"
    yield "| --- | --- | ---: | ---: | ---: |"
    for name, model, options, keyframe in models(suite):
        if name not in COMPARED:
            continue
        measured: dict[str, list[tuple[float, float, float]]] = {}
        for one in captured(model, options, keyframe):
            for solver, values in measure(one.step.problem, rounds).items():
                measured.setdefault(solver, []).append(values)
        for solver, values in measured.items():
            own, coulomb, seconds = np.array(values).T
            cells = (f"{np.median(track):.1e}, {np.quantile(track, 0.9):.1e}" for track in (own, coulomb))
            yield f"| {name} | {solver} | {' | '.join(cells)} | {_number(1e6 * np.median(seconds))} |"


@dataclass(frozen=True)
class FirstContact:
    """The thrown cube in its first step in contact.

    Attributes:
        own: residual of MuJoCo's forces under MuJoCo's model.
        coulomb: their residual under Coulomb's law, relative to the largest free velocity.
        impulse_error: their natural map Λ − P(Λ − ξ/α), relative to the largest impulse.
        robust: residual of Robust under Coulomb's law.
    """

    own: float
    coulomb: float
    impulse_error: float
    robust: float


def first_contact() -> FirstContact:
    """Judge the first step in contact of the thrown cube."""
    _, model, options, keyframe = next(models(None))
    step = next(captured(model, options, keyframe)).step
    verdict, residual = judge_step(step), Residual(step.problem)
    velocity = step.problem.delassus() @ step.impulses + step.problem.free_velocity
    violations = residual.of_laws(residual.unit * step.impulses, velocity)  # α ‖Λ − P(Λ − ξ/α)‖ of each law [m/s]
    largest = np.abs(step.impulses).max()
    solution = create("Robust").prepare(step.problem).solve(Stop(TOLERANCE))
    robust = judge(step.problem, solution.impulses).residual
    return FirstContact(verdict.own, verdict.coulomb, float((violations / residual.alpha).max() / largest), robust)


def thrown_rows() -> Iterator[str]:
    """Yield a row of Markdown with the residuals of the thrown cube in its first step in contact."""
    found = first_contact()
    yield "| Own model | Coulomb | Natural map / largest impulse | Robust, Coulomb |"
    yield "| ---: | ---: | ---: | ---: |"
    yield f"| {found.own:.1e} | {found.coulomb:.3f} | {found.impulse_error:.2f} | {found.robust:.1e} |"


def _number(value: float) -> str:
    """Return three digits without an exponent."""
    return f"{float(f'{value:.3g}'):.10g}"


def measure(problem: ContactProblem, rounds: int) -> dict[str, tuple[float, float, float]]:
    """Return both residuals of each solver, and the median of the wall times of interleaved solves [s]."""
    compared: dict[str, Stage | RobustSolve] = {one: Stage(problem, one) for one in ALGORITHMS}
    compared["Robust"] = RobustSolve(problem)
    times: dict[str, list[float]] = {solver: [] for solver in compared}
    for _ in range(rounds + 1):
        for solver, one in compared.items():
            one.begin()
            began = time.perf_counter()
            one.solve()
            times[solver].append(time.perf_counter() - began)
    found = {}
    for solver, one in compared.items():
        own, coulomb = (judge(problem, one.impulses(), law).residual for law in (Model.ENGINE, Model.COULOMB))
        found[solver] = own, coulomb, float(np.median(times[solver][1:]))
    return found


TABLES: dict[str, Callable[[argparse.Namespace], Iterator[str]]] = {
    "models": lambda options: model_rows(options.suite),
    "solvers": lambda options: solver_rows(options.suite, options.rounds),
    "thrown": lambda options: thrown_rows(),
}
"""Rows of each table."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=tuple(TABLES), help="what to print")
    parser.add_argument("--suite", type=Path, default=suite_folder(), help="folder of the models of dm_control")
    parser.add_argument("--rounds", type=int, default=20, help="timed solves of each solver on each step")
    options = parser.parse_args(arguments)
    gc.freeze()
    with threadpool_limits(1):
        for table in options.tables:
            for row in TABLES[table](options):
                print(row, flush=True)


if __name__ == "__main__":
    main()
