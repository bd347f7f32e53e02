"""What the built-in solvers share beside their methods: a name, and how they refuse problems and options."""

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import SolverError
from ...problems.names import described


class Method:
    """A built-in solver, a frozen dataclass of its options; see ``interface.Solver``.

    Unless it says otherwise it solves Coulomb friction, shows its iterates and treats every problem.
    """

    @property
    def has_iterates(self) -> bool:
        """Whether ``observe`` is called."""
        return True

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    @property
    def model(self) -> Model:
        """The model that is solved."""
        return Model.COULOMB

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def check_supports(self, problem: ContactProblem) -> None:
        """Raise ``SolverError`` if ``problem`` cannot be treated."""
        reason = self.supports(problem)
        if reason is not None:
            raise SolverError(f"{self.name} cannot treat {problem.name!r}: {reason}.")


def beyond_contacts(problem: ContactProblem) -> str | None:
    """Say which laws ``problem`` has beside contacts and sliding friction, as a reason to decline, or None."""
    if problem.laws.is_bilateral.any():
        return "it has joints (bilateral laws), and this method takes contacts with sliding friction alone"
    if problem.laws.is_rolling.any():
        return "it has rolling friction, and this method takes contacts with sliding friction alone"
    return None


def check_option(name: str, value: object, is_valid: bool, wanted: str) -> None:
    """Raise ``SolverError`` unless the value of an option is valid, that is ``wanted``."""
    if not is_valid:
        raise SolverError(f"{name} must be {wanted}, got {value!r}.")


def check_form(form: str) -> None:
    """Raise ``SolverError`` unless ``form`` says what of a problem is taken: G assembled, or W and M⁻¹."""
    check_option("form", form, form in ("delassus", "factors"), "'delassus' or 'factors'")
