"""Which force laws the rows of an FCLIB problem stand for, and what is not treated.

Contacts come first, all with ``spacedim`` rows, the normal one first: a unilateral law and the Coulomb friction that it
bounds. Bilateral rows (V, R or G; relative velocity zero) would follow them, and rolling friction would widen them.
"""

import numpy as np

from ...arrays import FloatArray
from ...contact.laws import Laws
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from .contents import Contents


def laws_of(contents: Contents) -> Laws:
    """Return the laws of a problem, in the order of its rows.

    Raises:
        ProblemError: for laws that are not treated, or a friction coefficient that is negative or not finite.
    """
    if contents.rolling:
        raise ProblemError("rolling friction (fclib_global_rolling) is not treated yet; there is no such law here.")
    if contents.bilateral:
        raise ProblemError(
            f"bilateral rows are not treated yet, and there are {contents.bilateral} of them (V and R, or G); "
            "eliminate them before writing."
        )
    if contents.dimension not in (2, 3):
        raise ProblemError(f"spacedim = {contents.dimension} must be 2 or 3, the rows of a contact.")
    return Laws.contacts(contents.friction, contents.dimension, len(contents.friction))


def contacts_of(problem: ContactProblem) -> tuple[int, FloatArray]:
    """Return the rows of a contact, 2 or 3, and μ of each contact, shape (n_contacts,).

    Raises:
        ProblemError: if the laws are not those of equal contacts with Coulomb friction, which FCLIB alone has.
    """
    laws, name = problem.laws, problem.name
    if not problem.n_rows:
        raise ProblemError(f"{name!r} has no contacts, so that there is nothing to write.")
    if not laws.is_friction.any():
        raise ProblemError(f"{name!r} has no friction, and contacts of FCLIB have it; give them a coefficient of zero.")
    if laws.fixed_bound.any():
        law = int(np.argmax(laws.fixed_bound > 0))
        raise ProblemError(f"law {law} of {name!r} has a fixed friction bound, and FCLIB has Coulomb friction only.")
    friction, dimension = laws.friction_coefficient[1::2], 1 + int(laws.kind.max())
    if laws.n_laws == 2 * len(friction):
        equal = Laws.contacts(friction, dimension, len(friction))
        if np.array_equal(laws.kind, equal.kind) and np.array_equal(laws.partner, equal.partner):
            return dimension, friction
    raise ProblemError(
        f"{name!r} mixes laws; FCLIB has contacts of one kind only, each a unilateral law with its friction behind it."
    )
