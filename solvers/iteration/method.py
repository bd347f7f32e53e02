"""Common parts of built-in solvers: names, and the checks of problems and options."""

from functools import cached_property

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import SolverError
from ...problems.names import name_with_options


class Method:
    """Base class of built-in solvers, which are frozen dataclasses of their options; see ``problems.contact.solver``.

    By default, a method solves Coulomb friction, passes its iterates to the observer, and accepts all problems.
    """

    @property
    def has_iterates(self) -> bool:
        """Whether ``observe`` is called."""
        return True

    @cached_property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return name_with_options(self)

    @property
    def model(self) -> Model:
        """The model that is solved."""
        return Model.COULOMB

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the method cannot solve ``problem``, or None."""
        return None

    def check_supports(self, problem: ContactProblem) -> None:
        """Raise ``SolverError`` if the method cannot solve ``problem``."""
        reason = self.supports(problem)
        if reason is not None:
            raise SolverError(f"{self.name} cannot solve {problem.name!r}: {reason}.")


def unsupported_laws(problem: ContactProblem) -> str | None:
    """Return why a method that supports only contacts with sliding friction cannot solve ``problem``, or None."""
    if problem.laws.is_bilateral.any():
        return "it has joints (bilateral laws), and this method supports only contacts with sliding friction"
    if problem.laws.is_rolling.any():
        return "it has rolling friction, and this method supports only contacts with sliding friction"
    return None


def check_option(name: str, value: object, is_valid: bool, requirement: str) -> None:
    """Raise ``SolverError`` unless the value of an option is valid."""
    if not is_valid:
        raise SolverError(f"{name} must be {requirement}, got {value!r}.")


def check_form(form: str) -> None:
    """Raise ``SolverError`` unless ``form`` names a form of the problem: G assembled, or its factors W and M⁻¹."""
    check_option("form", form, isinstance(form, str) and form in ("delassus", "factors"), "'delassus' or 'factors'")
