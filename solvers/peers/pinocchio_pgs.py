"""PinocchioPGS: the projected Gauss–Seidel sweeps of Pinocchio."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.matrices.memory import to_dense
from ...problems.contact.problem import ContactProblem
from ..iteration.method import Method, check_option
from .installed import check_installed
from .pinocchio_problem import Contacts, call_with_stack, pinocchio, unsupported_reason
from .rounds import Call, PreparedRounds, Round

UNREACHABLE = 1e-300
"""A tolerance that Pinocchio's criterion never meets; on spheres, one sweep would meet any usual tolerance."""

MAX_CONTACTS = 2500
"""Largest number of contacts; beyond it the dense matrix and its factor take more than a gigabyte."""


@dataclass(frozen=True)
class PinocchioPGS(Method):
    """Pinocchio's projected Gauss–Seidel sweeps over contacts in De Saxcé's form.

    They need a dense G. On contacts of spheres, one sweep meets Pinocchio's own criterion for any usual tolerance. Here
    only the judge's residual therefore stops the sweeps.

    Attributes:
        relaxation: factor of each step, between 0 and 2.

    Raises:
        SolverError: if Pinocchio is not installed, or an option is out of range.
    """

    relaxation: float = 1.0

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("PinocchioPGS", "pinocchio", "peers")
        is_valid = isinstance(self.relaxation, int | float) and 0.0 < self.relaxation < 2.0
        check_option("relaxation", self.relaxation, is_valid, "between 0 and 2")

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        if problem.n_contacts > MAX_CONTACTS:
            return f"it has {problem.n_contacts} contacts; with more than {MAX_CONTACTS}, the dense G takes gigabytes"
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedPGS":
        """Assemble scaled dense G and the contacts."""
        self.check_supports(problem)
        return PreparedPGS(problem, self)


class PreparedPGS(PreparedRounds):
    """The sweeps prepared for one problem."""

    first_iterations, growth = 4, 1.25

    def __init__(self, problem: ContactProblem, options: PinocchioPGS) -> None:
        super().__init__(problem)
        self._options, self._contacts = options, Contacts.of(problem)
        dense = to_dense(self._contacts.matrix, "use PinocchioADMM")
        pin = pinocchio()
        self._operator = call_with_stack(lambda: pin.DelassusOperatorDense(dense), problem.n_contacts)

    def begin(self, max_seconds: float) -> Call:
        """Return the call of the sweeps, whose only state is Λ."""
        pin, contacts = pinocchio(), self._contacts
        solver, settings, result = pin.PGSConstraintSolver(), pin.PGSSolverSettings(), pin.PGSSolverResult()
        settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
        settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = UNREACHABLE
        settings.over_relaxation = self._options.relaxation

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            settings.max_iterations = iterations
            result.setConstraintImpulseGuess(contacts.to_pinocchio(impulses))
            arguments = self._operator, contacts.velocity, contacts.models, contacts.datas, settings, result
            call_with_stack(lambda: solver.solve(*arguments), self.problem.n_contacts)
            return Round(contacts.from_pinocchio(result.retrieveConstraintImpulses()), iterations, False)

        return call
