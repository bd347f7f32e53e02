"""Common parts of built-in solvers: names, and the checks of problems and options."""

from functools import cached_property
from typing import ClassVar

from ...problems.contact.laws import LawKind
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import SolverError
from ...problems.names import name_with_options

SLIDING = frozenset(map(int, (LawKind.UNILATERAL, LawKind.PLANAR_FRICTION, LawKind.SPATIAL_FRICTION)))
"""Kinds of the laws of contacts with sliding friction."""

ROLLING = frozenset(map(int, (LawKind.PLANAR_ROLLING, LawKind.SPATIAL_ROLLING, LawKind.ROLLING_AND_SPINNING)))
"""Kinds of the laws of rolling friction."""


class Method:
    """Base class of built-in solvers, which are frozen dataclasses of their options; see ``problems.contact.solver``.

    By default, a method solves Coulomb friction, passes its iterates to the observer, and accepts all problems whose
    laws it knows.

    Attributes:
        law_kinds: values of ``LawKind`` that the method supports. A kind that is added to ``LawKind`` is not among
            them until the class states it.
    """

    law_kinds: ClassVar[frozenset[int]] = SLIDING | ROLLING | {int(LawKind.BILATERAL)}

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
        """Return why the method cannot solve ``problem``, or None; overriding methods call this one first."""
        return unsupported_laws(problem, self.law_kinds)

    def check_supports(self, problem: ContactProblem) -> None:
        """Raise ``SolverError`` if the method cannot solve ``problem``."""
        reason = self.supports(problem)
        if reason is not None:
            raise SolverError(f"{self.name} cannot solve {problem.name!r}: {reason}.")


def unsupported_laws(problem: ContactProblem, kinds: frozenset[int] = SLIDING) -> str | None:
    """Return why a method that supports laws of ``kinds`` cannot solve ``problem``, or None."""
    if problem.laws.kinds <= kinds:
        return None
    kind = LawKind(min(problem.laws.kinds - kinds))
    law = "joints (bilateral laws)" if kind == LawKind.BILATERAL else kind.description
    law, is_known = "rolling friction" if kind in ROLLING else law, kind in Method.law_kinds
    support = "supports only contacts with sliding friction" if is_known and kinds == SLIDING else "does not support it"
    return f"it has {law}, and this method {support}"


def check_option(name: str, value: object, is_valid: bool, requirement: str) -> None:
    """Raise ``SolverError`` unless the value of an option is valid."""
    if not is_valid:
        raise SolverError(f"{name} must be {requirement}, got {value!r}.")


def check_form(form: str) -> None:
    """Raise ``SolverError`` unless ``form`` names a form of the problem: G assembled, or its factors W and M⁻¹."""
    check_option("form", form, isinstance(form, str) and form in ("delassus", "factors"), "'delassus' or 'factors'")
