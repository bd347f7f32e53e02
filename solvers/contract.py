"""Whether a solver from outside keeps to the interface, in one sentence for its author.

Only the form is looked at here: members, signatures, names, and the types of what is returned. What a solver does is
the business of the conformance checks.
"""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from ..problems.contact.model import Model
from ..problems.contact.problem import ContactProblem
from ..problems.contact.solver import Solution, Status
from ..problems.errors import PluginError, ProxbenchError, first_line

_METHODS = {"supports": "supports(problem)", "prepare": "prepare(problem)"}

_SOLVE = "solve(stop, start=None, observe=None)"

MOST_ITERATIONS = 2**53
"""Largest number of iterations that is believed; it is a whole number also where tables hold it as a float."""


def made(name: str, source: str, factory: Any, options: dict[str, Any]) -> Any:
    """Return the solver that a plugin's class makes from ``options``, once it keeps to the interface.

    Args:
        name: the plain name that the plugin offers.
        source: the plugin, as messages call it.
        factory: the class, or a function that takes the options.
        options: by keyword.

    Raises:
        PluginError: if it does not keep to the interface.
        ProxbenchError: whatever the class itself raises for an option out of range.
    """
    head = f"solver {name} of {source}"
    check_factory(name, source, factory)
    try:
        solver = factory(**options)
    except (ProxbenchError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{head} cannot be created: {first_line(error)}.") from None
    fault = form_fault(solver) or _name_fault(solver, name, factory, options)
    if fault:
        raise PluginError(f"{head} breaks the contract: {fault}.")
    return solver


def check_factory(name: str, source: str, factory: Any) -> None:
    """Raise ``PluginError`` unless ``factory`` can be called without options."""
    head = f"solver {name} of {source}"
    if not callable(factory):
        raise PluginError(f"{head} is {_an(factory)}; offer the class that makes solvers, not {factory!r:.60}.")
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        raise PluginError(f"{head} has options that cannot be read; offer a class or a function.") from None
    for option in parameters:
        if option.kind not in (option.POSITIONAL_OR_KEYWORD, option.KEYWORD_ONLY):
            raise PluginError(f"{head} takes {option}; name every option, so that results can name them.")
        if option.default is option.empty:
            raise PluginError(f"{head} cannot be created without {option.name!r}; give every option a default value.")


def form_fault(solver: Any) -> str | None:
    """Say what a solver lacks of its interface (``Solver``), or None."""
    try:
        name, model = getattr(solver, "name", None), getattr(solver, "model", None)
    except Exception as error:
        return f"its name or model raised {first_line(error)}"
    if not isinstance(name, str) or not name:
        return _missing("name", name, "the text that tables show", "'MySolver'")
    if not isinstance(model, Model):
        return _missing("model", model, "what it solves", "Model.COULOMB")
    if not isinstance(getattr(solver, "has_iterates", True), bool):
        return f"its has_iterates is {_an(solver.has_iterates)}; it must be True or False"
    for method, wanted in _METHODS.items():
        fault = _method_fault(solver, method, wanted, lambda signature: signature.bind(None))
        if fault:
            return fault
    return None


def prepared_fault(prepared: Any) -> str | None:
    """Say what is wrong with the result of ``prepare`` (``Prepared``), or None."""
    fault = _method_fault(prepared, "solve", _SOLVE, _bind_solve)
    return None if fault is None else f"its prepare returned {_an(prepared)}, which {fault.removeprefix('it ')}"


def reason_fault(reason: Any) -> str | None:
    """Say what is wrong with an answer of ``supports``, or None."""
    if reason is None or (isinstance(reason, str) and reason.strip()):
        return None
    return f"its supports returned {reason!r:.60}; return None for a problem it takes, else the reason in words"


def solution_fault(problem: ContactProblem, solution: Any) -> str | None:
    """Say why ``solution`` cannot be one of ``problem``, whatever its numbers, or None."""
    fault = type_fault(solution)
    if fault:
        return fault
    impulses = solution.impulses
    if type(impulses) is not np.ndarray:  # a subclass may show every reader something else
        return f"it returned impulses of type {type(impulses).__name__}, not a plain numpy array"
    if impulses.shape != (problem.n_rows,):
        return f"it returned impulses of shape {impulses.shape}, not ({problem.n_rows},)"
    if impulses.dtype.kind != "f":
        return f"it returned impulses of type {impulses.dtype}, not float"
    if solution.status is Status.SOLVED and not np.isfinite(impulses).all():
        return "it claims to have solved with impulses that are not finite"
    return None


def type_fault(solution: Any) -> str | None:
    """Say why ``solution`` is not a ``Solution`` with a status, a count of iterations and a message, or None."""
    if type(solution) is not Solution:  # a subclass may compute its impulses when they are read
        kind = "a subclass of Solution" if isinstance(solution, Solution) else type(solution).__name__
        return f"its solve returned {kind}, not a Solution"
    status: Any = solution.status
    count: Any = solution.iterations
    message: Any = solution.message
    if not isinstance(status, Status):
        return f"it returned the status {status!r}, which is none"
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        return f"it returned {str(count)[:60]} as its number of iterations, which is no whole number"
    if not 0 <= count <= MOST_ITERATIONS:
        return f"it returned a number of iterations that is {'negative' if count < 0 else 'beyond 2**53'}"
    if not isinstance(message, str):
        return f"it returned a message of type {type(message).__name__}, not text"
    return None


def _name_fault(solver: Any, name: str, factory: Callable[..., Any], options: dict[str, Any]) -> str | None:
    """Say how a solver's name fails to make it again, or None: stored results lead back to solvers by their names."""
    plain, _, written_options = solver.name.partition("(")
    if plain != name:
        return f"it calls itself {solver.name!r}; its name must begin with {name!r}, under which it is offered"
    for option, parameter in inspect.signature(factory).parameters.items():
        differs = option in options and options[option] != parameter.default
        if differs and f"{option}=" not in written_options:
            return (
                f"with {option}={options[option]!r} it still calls itself {solver.name!r}; "
                "write options into the name, as name = property(described) does for a dataclass"
            )
    return None


def _missing(member: str, value: Any, meaning: str, example: str) -> str:
    if value is None:
        return f"it has no {member}, {meaning}; add {member} = {example}"
    return f"its {member} is {_an(value)}, not {meaning} such as {example}"


def _method_fault(thing: Any, name: str, wanted: str, bind: Callable[[inspect.Signature], object]) -> str | None:
    method = getattr(thing, name, None)
    if not callable(method):
        return f"it has no method {wanted}"
    try:
        signature = inspect.signature(method)
    except (TypeError, ValueError):
        return None  # compiled code need not have a signature
    try:
        bind(signature)
    except TypeError:
        return f"it has {name}{signature}, which cannot be called as {wanted}"
    return None


def _bind_solve(signature: inspect.Signature) -> None:
    signature.bind(None)
    signature.bind(None, start=None, observe=None)


def _an(value: Any) -> str:
    kind = type(value).__name__
    return f"{'an' if kind[:1].lower() in 'aeiou' else 'a'} {kind}"
