"""Checks that a plugin's solver implements the interface; a sentence describes each fault to the plugin's author.

Only the form is checked: members, signatures, names, and the types of return values. The conformance tests check the
behaviour.
"""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from ..problems.contact.model import Model
from ..problems.contact.problem import ContactProblem
from ..problems.contact.solver import Solution, Solver, Status
from ..problems.errors import PluginError, ProxbenchError, first_line, raised_at

_METHODS = {"supports": "supports(problem)", "prepare": "prepare(problem)"}

_SOLVE = "solve(stop, start=None, observe=None)"

MAX_ITERATIONS = 2**53
"""Largest accepted number of iterations; up to this number, floating-point columns of tables are exact."""


def make_solver(name: str, source: str, factory: Any, options: dict[str, Any]) -> Solver:
    """Create a solver from a plugin's class and ``options``, and check that it implements the interface.

    Args:
        name: the name of the solver without options, as the plugin registers it.
        source: the name of the plugin in messages.
        factory: the class, or a function of the options.
        options: keyword arguments of the factory.

    Raises:
        PluginError: if the solver does not implement the interface.
        ProxbenchError: if the class raises it, for example because an option is out of range.
    """
    head = f"solver {name} of {source}"
    check_factory(name, source, factory)
    try:
        solver = factory(**options)
    except (ProxbenchError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{head} cannot be created: {first_line(error)}{raised_at(error)}.") from None
    fault = form_fault(solver) or _name_fault(solver, name, factory, options)
    if fault:
        raise PluginError(f"{head} does not implement the solver interface: {fault}.")
    checked_solver: Solver = solver
    return checked_solver


def check_factory(name: str, source: str, factory: Any) -> None:
    """Raise ``PluginError`` unless ``factory`` can be called without options, and all its options have names."""
    head = f"solver {name} of {source}"
    if not callable(factory):
        raise PluginError(f"{head} is {_with_article(factory)}; provide the class of the solver, not {factory!r:.60}.")
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        raise PluginError(f"{head} has options that cannot be inspected; provide a class or a function.") from None
    for option in parameters:
        if option.kind not in (option.POSITIONAL_OR_KEYWORD, option.KEYWORD_ONLY):
            raise PluginError(f"{head} takes {option}; give every option a name, so that results can show it.")
        if option.default is option.empty:
            raise PluginError(f"{head} cannot be created without {option.name!r}; give every option a default value.")


def form_fault(solver: Any) -> str | None:
    """Return how a solver fails to implement ``Solver``, or None."""
    try:
        name, model = getattr(solver, "name", None), getattr(solver, "model", None)
    except Exception as error:
        return f"its name or model raised {first_line(error)}{raised_at(error)}"
    if not isinstance(name, str) or not name:
        return _missing("name", name, "the text in tables", "'MySolver'")
    if not isinstance(model, Model):
        return _missing("model", model, "the model that it solves", "Model.COULOMB")
    if not isinstance(getattr(solver, "has_iterates", True), bool):
        return f"its has_iterates is {_with_article(solver.has_iterates)}; it must be True or False"
    fault = _threads_fault(getattr(solver, "threads", 1))
    if fault:
        return fault
    for method, expected_call in _METHODS.items():
        fault = _method_fault(solver, method, expected_call, lambda signature: signature.bind(None))
        if fault:
            return fault
    return None


def _threads_fault(threads: Any) -> str | None:
    """Return what is wrong with a number of threads, or None."""
    if type(threads) is int and threads >= 1:
        return None
    return f"its threads is {threads!r:.60}; it must be a whole number, at least 1"


def prepared_fault(prepared: Any) -> str | None:
    """Return how the result of ``prepare`` fails to implement ``Prepared``, or None."""
    fault = _method_fault(prepared, "solve", _SOLVE, _bind_solve)
    if fault is not None:
        return f"its prepare returned {_with_article(prepared)}, which {fault.removeprefix('it ')}"
    fault = _threads_fault(getattr(prepared, "threads", 1))
    return fault and f"its prepare returned {_with_article(prepared)}, of which {fault.removeprefix('its ')}"


def reason_fault(reason: Any) -> str | None:
    """Return what is wrong with a result of ``supports``, or None."""
    if reason is None or (isinstance(reason, str) and reason.strip()):
        return None
    return f"its supports returned {reason!r:.60}; return None for a supported problem, otherwise the reason as text"


def solution_fault(problem: ContactProblem, solution: Any) -> str | None:
    """Return why ``solution`` does not have the form of a solution of ``problem``, or None."""
    fault = type_fault(solution)
    if fault:
        return fault
    impulses = solution.impulses
    if type(impulses) is not np.ndarray:  # a subclass may return different numbers at each access
        return f"it returned impulses of type {type(impulses).__name__}, not a plain numpy array"
    if impulses.shape != (problem.n_rows,):
        return f"it returned impulses of shape {impulses.shape}, not ({problem.n_rows},)"
    if impulses.dtype.kind != "f":
        return f"it returned impulses of type {impulses.dtype}, not float"
    if solution.status is Status.SOLVED and not np.isfinite(impulses).all():
        return "it returned the status 'solved' with impulses that are not finite"
    return None


def type_fault(solution: Any) -> str | None:
    """Return why ``solution`` is not a ``Solution`` with a valid status, number of iterations and message, or None."""
    if type(solution) is not Solution:  # a subclass may compute its impulses when they are read
        kind = "a subclass of Solution" if isinstance(solution, Solution) else type(solution).__name__
        return f"its solve returned {kind}, not a Solution"
    status: Any = solution.status
    count: Any = solution.iterations
    message: Any = solution.message
    if not isinstance(status, Status):
        return f"it returned {status!r}, which is not a Status"
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        return f"it returned {str(count)[:60]} as its number of iterations, which is not a whole number"
    if not 0 <= count <= MAX_ITERATIONS:
        return f"it returned a number of iterations that is {'negative' if count < 0 else 'larger than 2**53'}"
    if not isinstance(message, str):
        return f"it returned a message of type {type(message).__name__}, not text"
    return None


def _name_fault(solver: Any, name: str, factory: Callable[..., Any], options: dict[str, Any]) -> str | None:
    """Return why the solver cannot be recreated from its name, or None; results identify solvers by their names."""
    base_name, _, written_options = solver.name.partition("(")
    if base_name != name:
        return f"its name is {solver.name!r}, but must begin with {name!r}, its name in the plugin"
    for option, parameter in inspect.signature(factory).parameters.items():
        differs = option in options and options[option] != parameter.default
        if differs and f"{option}=" not in written_options:
            return (
                f"with {option}={options[option]!r} its name is still {solver.name!r}; "
                "include the options in the name, as name = property(name_with_options) does for a dataclass"
            )
    return None


def _missing(member: str, value: Any, meaning: str, example: str) -> str:
    if value is None:
        return f"it has no {member}, {meaning}; add {member} = {example}"
    return f"its {member} is {_with_article(value)}, not {meaning}, for example {example}"


def _method_fault(
    target: Any, name: str, expected_call: str, bind: Callable[[inspect.Signature], object]
) -> str | None:
    method = getattr(target, name, None)
    if not callable(method):
        return f"it has no method {expected_call}"
    try:
        signature = inspect.signature(method)
    except (TypeError, ValueError):
        return None  # compiled code may have no signature
    try:
        bind(signature)
    except TypeError:
        return f"it has {name}{signature}, which cannot be called as {expected_call}"
    return None


def _bind_solve(signature: inspect.Signature) -> None:
    signature.bind(None)
    signature.bind(None, start=None, observe=None)


def _with_article(value: Any) -> str:
    kind = type(value).__name__
    return f"{'an' if kind[:1].lower() in 'aeiou' else 'a'} {kind}"
