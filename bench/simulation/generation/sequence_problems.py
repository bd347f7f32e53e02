"""Problems of the suite ``sequences``: consecutive steps of scenes.

The motion that leads to the first step is solved to ``APPROACH_STOP``, and the steps of the sequence to ``STEP_STOP``,
so that all solvers are measured on the same, nearly exact motion. Contacts have the keys of the stepper.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....problems.contact.problem import FREE_FALL, ContactProblem
from ....problems.contact.solver import Stop
from ....problems.errors import ProblemError
from ....problems.exchange.catalog import SEQUENCE_MEMBERS, SEQUENCE_STEPS
from ....problems.exchange.sequences import BEFORE, STEP
from ....problems.motion.bodies.system import ActiveContacts
from ....problems.motion.scenes.funnel import STANDARD_GRAVITY
from ....problems.motion.scenes.registry import make_scene
from ....problems.motion.state import State
from ....problems.motion.stepping.midpoint import MidpointRule
from ....solvers.registry import create

APPROACH_STOP = Stop(tolerance=1e-4, max_iterations=2000, max_seconds=600.0)
"""Solver limits of the motion before a sequence."""

STEP_STOP = Stop(tolerance=1e-10, max_iterations=200_000, max_seconds=600.0)
"""Solver limits of the steps of a sequence."""


@dataclass(frozen=True)
class SequenceRecipe:
    """The first step of a sequence.

    Attributes:
        scene: the scene with its options.
        time: time at the beginning of the step [s].
    """

    scene: str
    time: float = 0.0


SEQUENCE_RECIPES = {
    "flow-30": SequenceRecipe("funnel(balls=30, outlet=0)", 0.45),
    "flow-300": SequenceRecipe("funnel(balls=300)", 0.29),
    "flow-1000": SequenceRecipe("funnel", 0.3),
    "pile-100": SequenceRecipe("pile(balls=100)", 1.5),
    "pile-300": SequenceRecipe("pile(balls=300)", 1.5),
    "hopper-100": SequenceRecipe("hopper", 0.3),
    "dominoes-20": SequenceRecipe("dominoes", 0.3),
    "stack-10": SequenceRecipe("box_stack", 0.05),
    "arch-13": SequenceRecipe("arch(stones=13)", 0.05),
    "chain-20": SequenceRecipe("chain(n_links=20)", 0.1),
}
"""Recipe of each sequence."""

SEQUENCE_OF_PROBLEM = {step: name for name, steps in SEQUENCE_MEMBERS.items() for step in steps}
"""The sequence of each problem of the suite."""


def sequence_problems(name: str) -> Iterator[ContactProblem]:
    """Yield the steps of a sequence.

    Raises:
        ProblemError: if a step has no contact.
    """
    recipe = SEQUENCE_RECIPES[name]
    scene, previous = make_scene(recipe.scene), ""
    length = scene.step_size
    stepper = MidpointRule(scene.system, create("Robust"), STEP_STOP, length, depth=scene.depth)
    steps = zip(SEQUENCE_MEMBERS[name], stepper.steps(first_state(recipe), SEQUENCE_STEPS), strict=True)
    for number, (member, step) in enumerate(steps, round(recipe.time / length)):
        if step.problem is None or step.contacts is None:
            raise ProblemError(f"no contact is active in step {number} of the scene of {member!r}.")
        origin: dict[str, str | int | float] = {
            "scene": recipe.scene,
            STEP: number,
            FREE_FALL: STANDARD_GRAVITY * length,
        }
        origin |= {BEFORE: previous} if previous else {}
        yield step.problem.keyed(contact_names(step.problem, step.contacts)).renamed(member, **origin)
        previous = member


def first_state(recipe: SequenceRecipe) -> State:
    """Return the state at the beginning of the first step of a sequence."""
    scene = make_scene(recipe.scene)
    state, length = scene.start, scene.step_size
    approach = MidpointRule(scene.system, create("MomentumFallback"), APPROACH_STOP, length, depth=scene.depth)
    for step in approach.steps(state, round(recipe.time / length)):
        state = step.state
    return state


def contact_names(problem: ContactProblem, contacts: ActiveContacts) -> list[str]:
    """Return the key of each contact of a step as text.

    Each row of a joint is a contact; the text of every row except the first contains its number.
    """
    row_of_contact = [0] * problem.n_contacts
    owners = contacts.for_rows(contacts.keys)
    row_numbers = np.arange(problem.n_rows) - contacts.for_rows(contacts.first_rows)
    for row in reversed(range(problem.n_rows)):
        row_of_contact[problem.layout.contact_of_row[row]] = row
    return [
        f"{owners[row]}" if row_numbers[row] == 0 else f"{owners[row]} row {row_numbers[row]}" for row in row_of_contact
    ]
