"""Count contacts of bodies at rest that vanish from one step to the next because they open or change their keys.

``costs_of_accuracy.py --tables vanishing`` prints the table.
"""

from collections.abc import Iterator
from typing import Any

from proxbench.problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import Stop, create

SETTINGS = (
    ("box_stack", 10e-3, 1e-6),
    ("box_stack", 10e-3, 1e-4),
    ("box_stack(overlap=1e-9)", 10e-3, 1e-6),
    ("arch", 5e-3, 1e-6),
)
"""Scene, Δt [s] and tolerance."""

STEPS = 1000
MAX_ITERATIONS = 5000

NEAR = 1e-3
"""Gap [m] below which a contact still has its key."""


def vanishing(count: int = STEPS) -> Iterator[dict[str, Any]]:
    """Yield how many contacts vanish, how many of them open, and how many return, in ``count`` steps of each scene."""
    for text, step, tolerance in SETTINGS:
        yield {"scene": text, "step": step, "tolerance": tolerance, **count_vanishing(text, step, tolerance, count)}


def count_vanishing(text: str, step: float, tolerance: float, count: int) -> dict[str, float]:
    """Return the contacts that vanish, open and return, and the mean number of iterations per step."""
    scene = make_scene(text)
    system = scene.system
    assert isinstance(system, RigidBodies)
    rule = MidpointRule(system, create("Robust"), Stop(tolerance, MAX_ITERATIONS), step)
    before, gone = set[int](), set[int]()
    vanished = opened = returned = iterations = 0
    for taken in rule.steps(scene.start, count):
        keys = set[int]() if taken.contacts is None else set(taken.contacts.keys.tolist())
        iterations += taken.iterations
        if out := before - keys:
            midpoint = system.move(taken.state.position, taken.state.velocity, -0.5 * step)
            opened += len(out & set(system.gaps_below(midpoint, NEAR)[0].tolist()))
        vanished, returned = vanished + len(out), returned + len(keys & gone)
        gone, before = (gone | out) - keys, keys
    return {"vanished": vanished, "opened": opened, "returned": returned, "iterations": iterations / count}
