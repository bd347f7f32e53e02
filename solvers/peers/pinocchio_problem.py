"""Contact problems in the form of Pinocchio's constraint solvers, and calls of Pinocchio.

Pinocchio (Carpentier et al.) solves for σ over contacts

    K_μ ∋ σ  ⊥  Gσ + g + s(σ) ∈ K_μ*      s = μ‖(Gσ + g)_T‖ e_N

which is Coulomb's law in De Saxcé's form. Pinocchio's contacts have the rows T1, T2, N. The data are scaled by units of
the problem (``Scaling``): G has a diagonal of about 1 and g is at most 1. Absolute tolerances then have the same
meaning for every problem. For ADMM, they nearly equal tolerances of the judge's residual. In SI units, any impulses of
small bodies would satisfy Pinocchio's default tolerances, which are absolute.
"""

import importlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import Laws
from ...problems.contact.problem import ContactProblem
from ..conic.programs import Scaling

STACK_BYTES, STACK_BYTES_OF_CONTACT = 64 * 2**20, 128 * 2**10
"""Stack size of a call [bytes]: a constant, and an addition per contact. The usual 8 MiB cause a segmentation fault
with more than 341 contacts."""

Answer = TypeVar("Answer")


def pinocchio() -> Any:
    """Return the module pinocchio, imported at first use; external solvers run in child processes only."""
    return importlib.import_module("pinocchio")


def unsupported_reason(problem: ContactProblem) -> str | None:
    """Return why Pinocchio's point contacts cannot represent ``problem``, or None."""
    laws = problem.laws
    n_contacts = laws.n_laws // 2
    expected = Laws.contacts(laws.friction_coefficient[1::2], 3, n_contacts) if 2 * n_contacts == laws.n_laws else None
    if (
        expected is None
        or not np.array_equal(laws.kind, expected.kind)
        or not np.array_equal(laws.partner, expected.partner)
    ):
        kinds = ", ".join(sorted(laws.counts()))
        return f"Pinocchio supports only contacts with spatial Coulomb friction, but the laws are {kinds}"
    if laws.fixed_bound.any():
        return "it has fixed friction bounds, which Pinocchio does not support"
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric"
    return None


@dataclass(frozen=True)
class Contacts:
    """The contacts of a problem in Pinocchio's terms.

    Attributes:
        matrix: scaled G in Pinocchio's order of rows, a scipy csc_matrix with 32-bit indices, shape (n_rows, n_rows).
        velocity: scaled c in that order, shape (n_rows,).
        order: row of the problem for each row of the matrix, shape (n_rows,).
        impulse: scale of the impulse of each row of the problem [N s], shape (n_rows,).
        models: constraint models, one per contact; their kinematics are not used.
        datas: data of the constraint models.
    """

    matrix: Any
    velocity: FloatArray
    order: IntArray
    impulse: FloatArray
    models: Any
    datas: Any

    @staticmethod
    def of(problem: ContactProblem) -> "Contacts":
        """Return the contacts of a problem that Pinocchio supports."""
        pin = pinocchio()
        scaling = Scaling(problem)
        order = np.arange(problem.n_rows).reshape(-1, 3)[:, [1, 2, 0]].ravel()
        unit = sp.diags_array(scaling.impulse / np.sqrt(scaling.energy))
        scaled = sp.csc_array(unit @ problem.delassus() @ unit)[order][:, order]
        matrix = sp.csc_matrix(scaled)
        matrix.sort_indices()
        matrix.indices, matrix.indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
        velocity = (problem.free_velocity * scaling.impulse / scaling.energy)[order]
        body = pin.Model()
        body.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
        models, datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for friction in problem.layout.friction_coefficient:
            contact = pin.PointContactConstraintModel(body, 1, pin.SE3.Identity())
            contact.setFriction(float(friction))
            models.append(pin.ConstraintModel(contact))
            datas.append(models[len(models) - 1].createData())
        return Contacts(matrix, velocity, order, scaling.impulse, models, datas)

    def from_pinocchio(self, answer: FloatArray) -> FloatArray:
        """Return Λ over rows [N s] from a solution of Pinocchio."""
        impulses = np.empty_like(answer)
        impulses[self.order] = answer
        return impulses * self.impulse

    def to_pinocchio(self, impulses: FloatArray) -> FloatArray:
        """Return the initial impulses for Pinocchio from Λ over rows [N s]."""
        first: FloatArray = (impulses / self.impulse)[self.order]
        return first


def call_with_stack(call: Callable[[], Answer], n_contacts: int) -> Answer:
    """Return the result of ``call``, run in a thread whose stack is large enough for ``n_contacts``.

    Raises:
        BaseException: any exception that ``call`` raises.
    """
    results: list[Answer] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            results.append(call())
        except BaseException as error:
            errors.append(error)

    previous_size = threading.stack_size(STACK_BYTES + n_contacts * STACK_BYTES_OF_CONTACT)
    try:
        thread = threading.Thread(target=run)
        thread.start()
    finally:
        threading.stack_size(previous_size)
    thread.join()
    if errors:
        raise errors[0]
    return results[0]
