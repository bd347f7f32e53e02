"""Pinocchio's projected Gauss–Seidel sweeps, called as they are."""

from dataclasses import dataclass
from typing import ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..iteration.method import Method, check_option
from .installed import check_installed, imported
from .pinocchio_problem import Contacts, obstacle, on_deep_stack
from .rounds import Call, InRounds, Round

NEVER_MET = 1e-300
"""A tolerance that its own criterion never meets: of spheres it reports convergence after the first sweep."""

MOST_CONTACTS = 2500
"""Contacts beyond which its dense matrix and the factor of it take more than a gigabyte."""


@dataclass(frozen=True)
class PinocchioPGS(Method):
    """Projected Gauss–Seidel sweeps over contacts in De Saxcé's form, of Pinocchio.

    They take a dense G. Their own criterion is met after one sweep on contacts of spheres, whatever the tolerance, so
    that the judge alone ends them.

    Attributes:
        relaxation: factor of each step, between 0 and 2.

    Raises:
        SolverError: if Pinocchio is not installed, or an option is out of range.
    """

    relaxation: float = 1.0

    has_iterates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_installed("PinocchioPGS", "pinocchio")
        check_option("relaxation", self.relaxation, 0.0 < self.relaxation < 2.0, "between 0 and 2")

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if problem.n_contacts > MOST_CONTACTS:
            return f"it has {problem.n_contacts} contacts, and the dense G of more than {MOST_CONTACTS} takes gigabytes"
        return obstacle(problem)

    def prepare(self, problem: ContactProblem) -> "PreparedPGS":
        """Assemble G, dense and in units of its own, and the contacts."""
        self.check_supports(problem)
        return PreparedPGS(problem, self)


class PreparedPGS(InRounds):
    """The sweeps made ready for one problem."""

    first_iterations, growth = 4, 1.25

    def __init__(self, problem: ContactProblem, options: PinocchioPGS) -> None:
        super().__init__(problem)
        self._options, self._contacts = options, Contacts.of(problem)
        dense = self._contacts.matrix.toarray()
        pin = imported("pinocchio")
        self._operator = on_deep_stack(lambda: pin.DelassusOperatorDense(dense), problem.n_contacts)

    def begin(self, max_seconds: float) -> Call:
        """Return the sweeps; what they know is Λ alone."""
        pin, contacts = imported("pinocchio"), self._contacts
        solver, settings, result = pin.PGSConstraintSolver(), pin.PGSSolverSettings(), pin.PGSSolverResult()
        settings.relative_feasibility_tol = settings.relative_complementarity_tol = 0.0
        settings.absolute_feasibility_tol = settings.absolute_complementarity_tol = NEVER_MET
        settings.over_relaxation = self._options.relaxation

        def call(impulses: FloatArray, tolerance: float, iterations: int) -> Round:
            settings.max_iterations = iterations
            result.setConstraintImpulseGuess(contacts.theirs(impulses))
            arguments = self._operator, contacts.velocity, contacts.models, contacts.datas, settings, result
            on_deep_stack(lambda: solver.solve(*arguments), self.problem.n_contacts)
            return Round(contacts.ours(result.retrieveConstraintImpulses()), iterations, False)

        return call
