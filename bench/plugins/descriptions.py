"""Descriptions of plugins and of the caller's solvers, which are imported and created in a child process.

The process returns JSON, and problems as the content of problem files.
"""

import io
from dataclasses import dataclass
from typing import Any

import cloudpickle

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import (
    Solver,
    SolverError,
    draws_randomly,
    shows_iterates,
    starts_from_last_answer,
    threads_of,
)
from ...problems.errors import PluginError, ProxbenchError, first_line, raised_at
from ...problems.exchange.catalog import load, plugin_problems
from ...problems.exchange.files.problem_file import problem_bytes, read_problem
from ...problems.exchange.plugins.files import PluginFile
from ...problems.exchange.plugins.offers import KINDS, Names, Offer, forget, register
from ...problems.exchange.plugins.scenes import plugin_scene, plugin_scenes, scene_options
from ...solvers import registry
from ...solvers.contract import form_fault
from ...solvers.native.native_solver import NativeSolver
from ..errors import BenchError
from ..isolation.worker import REQUEST_SECONDS, Fault, RenewedWorker
from ..store.outcome import Outcome
from .documentation import option_texts
from .native_files import use_native_files
from .solver_specs import SolverSpec, built_in, pickle_solver

_PACKAGE = f"{__name__.partition('.')[0]}."
"""Prefix of the modules of this package, whose solvers may have the names of built-in ones."""


def solver_spec(solver: str | Solver | SolverSpec) -> SolverSpec:
    """Return the specification of a solver, given by its name or as an object.

    Raises:
        SolverError: for an unknown solver or option; the message suggests the nearest name.
        PluginError: if the solver of a plugin cannot be created, or violates the interface.
        BenchError: if an object violates the interface, or cannot be sent to another process.
    """
    if isinstance(solver, str):
        is_built_in = registry.find_offer(solver) is None and not registry.native_parts(solver)
        return built_in(solver) if is_built_in else _describe_spec(solver, b"", PluginError)
    if isinstance(solver, SolverSpec):
        return solver
    if isinstance(solver, type):
        raise BenchError(f"the solver {solver.__name__} is a class; pass an instance, {solver.__name__}().")
    if _is_of_package(solver):
        return solver_spec(solver.name)
    return _describe_spec("", pickle_solver(solver), BenchError)


def all_offers() -> tuple[Offer, ...]:
    """Return the offers of plugins that are known without importing the plugins, solvers first."""
    return (*registry.plugin_solvers(), *plugin_problems(), *plugin_scenes())


def offers_of_file(file: PluginFile, seconds: float = REQUEST_SECONDS) -> Names:
    """Return the names that a plugin file provides, by kind, after creating and checking each solver.

    Args:
        file: the file.
        seconds: wall time limit to import the file and create its solvers [s].

    Raises:
        PluginError: if the file cannot be imported, or provides nothing, a name that is taken, or a solver that
            violates the interface.
    """
    answer, _ = _ask(f"{file.source} fails to import", PluginError, "offers", file, seconds=seconds)
    return {kind: tuple(map(str, answer["offers"][kind])) for kind in KINDS}


def describe_solver(name: str) -> dict[str, Any]:
    """Return the description of a solver of a plugin: its name, model, source, options and declarations.

    Raises:
        PluginError: if the solver cannot be created, or violates the interface.
    """
    return _ask(f"the solver {name!r} cannot be created", PluginError, "solver", name, b"")[0]


def describe_scene(name: str) -> list[str]:
    """Return the options of a scene of a plugin with their defaults.

    Raises:
        PluginError: if the plugin cannot be imported, or an option has no default.
    """
    answer, _ = _ask(f"the scene {name!r} cannot be created", PluginError, "scene", name)
    return [str(option) for option in answer["options"]]


def plugin_problem(name: str) -> ContactProblem:
    """Return a problem of a plugin.

    Raises:
        PluginError: if the plugin does not create the problem.
    """
    _, content = _ask(f"the problem {name!r} cannot be built", PluginError, "problem", name)
    return read_problem(io.BytesIO(content), f"problem {name!r}")


def _describe_spec(name: str, pickled: bytes, error: type[ProxbenchError]) -> SolverSpec:
    """Return the specification of a solver, given by its name or as a pickled object; raise ``error`` on a fault."""
    what = f"the solver {name!r}" if name else "the solver object"
    answer, _ = _ask(f"{what} cannot be created", error, "solver", name, pickled)
    if not name:
        _check_name_is_free(answer["name"])
    elif _plain_names(answer["name"]) != _plain_names(name):
        raise error(f"{what} has the name {answer['name']!r:.200}; set its name to the one that creates it.")
    model, offer = Model.from_text(answer["model"]), registry.find_offer(name) if name else None
    source = offer.source if offer is not None else answer["source"] or name  # never that of a built-in solver
    files = use_native_files(answer["name"], answer["native"])
    return SolverSpec(
        answer["name"],
        model,
        answer["has_iterates"],
        source,
        pickled,
        is_randomised=answer["is_randomised"],
        threads=int(answer["threads"]),
        files=files,
        starts_warm=answer["starts_warm"],
    )


def require_free_name(solver: Solver) -> None:
    """Check that a solver object does not have the name of a built-in solver, unless its class is of this package.

    Raises:
        BenchError: if it has such a name.
    """
    if not _is_of_package(solver):
        _check_name_is_free(solver.name)


def _is_of_package(solver: Solver) -> bool:
    """Return whether the class of a solver is defined in this package."""
    return type(solver).__module__.startswith(_PACKAGE)


def _check_name_is_free(name: str) -> None:
    """Raise ``BenchError`` if a name, without its options, is that of a built-in solver."""
    plain = name.partition("(")[0].strip()
    if registry.is_built_in(plain):
        raise BenchError(f"the solver object has the name {name!r:.200}, which Proxbench itself uses; rename it.")


def _plain_names(name: str) -> list[str]:
    """Return the plain names of a solver and of its parts; only the first if an option is not a literal."""
    try:
        return registry.plain_names(name)
    except SolverError:
        return [name.partition("(")[0]]


def _ask(
    failure: str, error: type[ProxbenchError], request: str, *arguments: Any, seconds: float = REQUEST_SECONDS
) -> tuple[dict[str, Any], bytes]:
    """Return the answer of a new process.

    Raises:
        ProxbenchError: of the class ``error``, if the process rejects the request, or with ``failure`` if it gives no
            answer.
    """
    with RenewedWorker(DescribingTask(), seconds) as worker:
        try:
            answer, content = worker.ask(request, *arguments)
        except Fault as fault:
            reason = f"it does not end within {seconds:g} s" if fault.outcome is Outcome.TIMEOUT else fault.reason
            raise error(f"{failure}: {reason}; correct the code that it runs.") from None
    if "refused" in answer:
        raise error(str(answer["refused"]))
    return answer, content


@dataclass
class DescribingTask:
    """The task of the child. Requests: "offers" (file), "solver" (name, pickled object), "problem", "scene" (name)."""

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer one request; if it raises a ``ProxbenchError``, the answer is {"refused": message}."""
        try:
            if request == "offers":
                return {"offers": _offers(*arguments)}, b""
            if request == "solver":
                return _solver(*arguments), b""
            if request == "scene":
                return {"options": _scene_options(*arguments)}, b""
            return {}, problem_bytes(load(*arguments))
        except ProxbenchError as error:
            return {"refused": str(error)}, b""


def _offers(file: PluginFile) -> dict[str, list[str]]:
    """Return the names that a plugin file provides, by kind, after creating each solver; or raise ``PluginError``."""
    forget(file)  # the known names are those of an earlier import of the file
    register(file)
    file.check_offers()
    offers = [offer for offer in all_offers() if offer.file == file]
    for offer in offers:
        if offer.rejection:
            raise PluginError(offer.rejection)
        if offer.kind == "solver":
            registry.create(offer.name)
    return {kind: [offer.name for offer in offers if offer.kind == kind] for kind in KINDS}


def _solver(name: str, pickled: bytes) -> dict[str, Any]:
    """Create a solver by its name, or from a pickled object, and return its description."""
    if pickled:
        return _solver_description(_unpickled(pickled), "", [], [])
    solver, offer = registry.create(name), registry.find_offer(name)
    native = [
        part.source for part in map(registry.create, registry.native_parts(name)) if isinstance(part, NativeSolver)
    ]
    source = offer.source if offer is not None else ", ".join(native)
    return _solver_description(solver, source, option_texts(registry.parse(name).plain), native)


def _scene_options(name: str) -> list[str]:
    """Return the options of a scene of a plugin, as ``"step=0.1"``."""
    offer = plugin_scene(name)
    assert offer is not None
    options = scene_options(offer.load(), f"scene {name!r} of {offer.source}")
    return [f"{key}={value!r}" for key, value in options.items()]


def _solver_description(solver: Solver, source: str, options: list[str], native: list[str]) -> dict[str, Any]:
    """Return the declarations of a solver as JSON values; raise ``BenchError`` if it violates the interface."""
    fault = form_fault(solver)
    if fault:
        raise BenchError(f"the solver {type(solver).__name__} violates the interface: {fault}.")
    return {
        "name": solver.name,
        "model": str(solver.model),
        "has_iterates": shows_iterates(solver),
        "is_randomised": draws_randomly(solver),
        "starts_warm": starts_from_last_answer(solver),
        "threads": threads_of(solver),
        "source": source,
        "options": options,
        "native": native,
    }


def _unpickled(pickled: bytes) -> Any:
    """Return the solver object of a pickle; raise ``BenchError`` if it cannot be created."""
    try:
        return cloudpickle.loads(pickled)
    except Exception as error:
        raise BenchError(
            f"the solver object cannot be created in the process of its cases: {first_line(error)}{raised_at(error)}; "
            "define its class where that process can import it, or in the script itself."
        ) from None
