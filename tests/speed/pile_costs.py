"""Measure the time of a step of a pile of boxes, and the part for finding contacts.

Boxes between four walls fall into a pile for 1.5 s, like those of the suite ``bodies``. The steps after that
are timed. ``costs_of_accuracy.py --tables piles`` prints the table.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from proxbench.bench.simulation.generation.box_scenes import BoxPile
from proxbench.bench.simulation.step_row import judged_residual
from proxbench.problems.arrays import FloatArray
from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.detection.narrow_phase import ContactSet
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.problems.motion.stepping.step import Step
from proxbench.solvers import Status, Stop, create

SIZES = (100, 1000, 5000)
STEP = 2e-3
SETTLING_STEPS = 750
TIMED_SECONDS = 2.0
"""Processor time for which steps are timed [s]."""

TOLERANCE = 1e-4
SOLVES = (("SORprox(relaxation=1.3)", 50), ("SORprox(relaxation=1.3)", 5000), ("MomentumFallback", 5000))
"""Solvers with their largest numbers of sweeps in a step. The boxes fall with the first one."""

MAX_BOXES_FOR_RANK = 1000
"""Largest number of boxes for which the rank is computed, from all eigenvalues."""


@dataclass(frozen=True, eq=False)
class TimedBodies(RigidBodies):
    """Rigid bodies that add up the processor time of finding contacts."""

    def contacts_within(self, poses: FloatArray, margin: float) -> ContactSet:
        """Return the contacts with a gap of less than ``margin`` [m]."""
        began = time.process_time()
        found = super().contacts_within(poses, margin)
        _detecting[0] += time.process_time() - began
        return found


_detecting = [0.0]


def piles(
    sizes: tuple[int, ...] = SIZES, settling_steps: int = SETTLING_STEPS, solves: tuple[tuple[str, int], ...] = SOLVES
) -> Iterator[dict[str, Any]]:
    """Yield contacts, redundancy and times of a step of each pile, and the growth of the time with the contacts."""
    before: dict[tuple[str, int], tuple[float, float]] = {}
    for n_boxes in sizes:
        scene = BoxPile(n_boxes)
        plain = scene.system()
        system = TimedBodies(**{name: getattr(plain, name) for name in plain.__dataclass_fields__})
        *_, settled = _rule(system, *solves[0]).steps(scene.start(), settling_steps)
        for solve in solves:
            row = _timed_steps(system, settled, *solve)
            if solve in before:
                contacts, milliseconds = before[solve]
                row["growth"] = np.log(row["ms a step"] / milliseconds) / np.log(row["contacts"] / contacts)
            before[solve] = (row["contacts"], row["ms a step"])
            yield {"boxes": n_boxes, "solver": solve[0], "sweeps": solve[1], **row}


def _rule(system: RigidBodies, solver: str, sweeps: int) -> MidpointRule:
    return MidpointRule(system, create(solver), Stop(TOLERANCE, sweeps), STEP, depth=1e-4)


def _timed_steps(system: RigidBodies, last: Step, solver: str, sweeps: int) -> dict[str, Any]:
    """Return means and the median residual of the steps that fit into ``TIMED_SECONDS``, and the last contacts."""
    rule = _rule(system, solver, sweeps)
    _detecting[0], total, residuals, converged = 0.0, 0.0, list[float](), 0
    while total < TIMED_SECONDS:
        began = time.process_time()
        last = rule.step(last.state)
        total += time.process_time() - began
        converged += last.status is Status.SOLVED
        residuals.append(judged_residual(last))
    count = len(residuals)
    seconds, detecting = total / count, _detecting[0] / count
    assert last.contacts is not None
    n_boxes, rows = system.n_bodies, last.contacts.laws.n_rows
    is_small = n_boxes <= MAX_BOXES_FOR_RANK
    return {
        "contacts": last.contacts.n_contacts,
        "rows/velocities": rows / (6 * n_boxes),
        "rows - rank": rows - _rank(system, last.contacts) if is_small else f"> {rows - 6 * n_boxes}",
        "converged": f"{converged} of {count}",
        "residual": float(np.median(residuals)),
        "ms a step": 1e3 * seconds,
        "detection": detecting / seconds,
        "growth": "",
    }


def _rank(system: RigidBodies, contacts: Any) -> int:
    """Return the rank of WᵀM⁻¹W, from the eigenvalues of the smaller matrix with the same ones."""
    scaled = system.inverse_mass.matrix.sqrt() @ contacts.directions.to_csc()
    values = np.linalg.eigvalsh((scaled @ scaled.T).toarray())
    return int((values > 1e-10 * values[-1]).sum())
