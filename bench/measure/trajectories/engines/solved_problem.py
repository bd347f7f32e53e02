"""Contact problems of single steps of an engine, with the impulses that it returned as their solution."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from .....problems.arrays import FloatArray
from .....problems.contact.problem import ContactProblem
from .....problems.exchange.formats.rigid_bodies import problem_of_arrays
from .....problems.exchange.repair import Repair
from .description import BodyStates, Description


@dataclass(frozen=True, eq=False)
class SolvedProblem:
    """The problem of one step under Coulomb's law, with the answer of the engine.

    Attributes:
        problem: the problem.
        impulses: the impulses Λ of the engine [N s], shape (n_rows,).
        own_residual: residual of the impulses under the engine's own model; None if the engine publishes none.
    """

    problem: ContactProblem
    impulses: FloatArray
    own_residual: float | None = None


def solved_problem(
    description: Description, before: BodyStates, time_step: float, contacts: dict[str, Any], impulses: FloatArray
) -> SolvedProblem | None:
    """Return the problem of a step with the impulses of the engine; None without contacts.

    Args:
        description: the scene.
        before: the states of the bodies before the step.
        time_step: time step [s].
        contacts: the arrays of contacts, named as in the format ``bodies``.
        impulses: Λ_N, Λ_T1, Λ_T2 of each contact on its body 2 [N s], shape (n_contacts, 3).
    """
    if not len(impulses):
        return None
    bodies = description.bodies
    arrays = {
        "mass": [body.mass for body in bodies],
        "inertia": [3 * [body.inertia] for body in bodies],
        "position": before.positions,
        "velocity": before.velocities,
        "angular_velocity": before.spins,
        "gravity": description.gravity,
        "time_step": time_step,
        "mu": description.friction,
    }
    problem = problem_of_arrays({name: np.asarray(value) for name, value in (arrays | contacts).items()}, Repair())
    return SolvedProblem(problem, impulses.ravel())
