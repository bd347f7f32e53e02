"""The registry of solvers, including those of plugins: it creates solvers from names with options."""

import inspect
import re
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..problems.compilation.interpretation import interprets_kernels
from ..problems.contact.problem import ContactProblem
from ..problems.contact.solver import (
    Solution,
    Solver,
    SolverError,
    Status,
    Stop,
    check_limit_names,
    starts_from_last_answer,
)
from ..problems.errors import suggestion
from ..problems.exchange.catalog import load
from ..problems.exchange.plugins.offers import Offer, offers
from ..problems.names import Name, check_options, read_name
from . import contract

BUILT_IN = {
    "Robust": "composite.robust",
    "Jprox": "prox.jorprox",
    "JORprox": "prox.jorprox",
    "SORprox": "prox.sorprox",
    "ColouredSORprox": "prox.coloured_sorprox",
    "SafeguardedSORprox": "prox.safeguarded_sorprox",
    "NesterovSORprox": "prox.accelerated_sorprox",
    "AndersonSORprox": "prox.accelerated_sorprox",
    "NSGS": "prox.nsgs",
    "SemismoothNewton": "newton.semismooth_newton",
    "ProximalADMM": "prox.proximal_admm",
    "APGD": "prox.apgd",
    "SAP": "newton.sap",
    "InteriorPoint": "interior.interior_point",
    "CentralPath": "interior.central_path",
    "MomentumFallback": "composite.fallback",
    "ClarabelSOCP": "conic.clarabel_socp",
    "ClarabelCoulomb": "conic.clarabel_coulomb",
    "CvxpyCoulomb": "conic.cvxpy_coulomb",
    "Lemke": "lcp.lemke",
    "PyramidPGS": "lcp.projected_gauss_seidel",
    "Enumeration": "lcp.enumeration",
}
"""Module of each built-in solver, imported when the solver is created."""

PARTS = {
    "InteriorNewton": "composite.interior_newton",
    "HybridNewton": "composite.hybrid_newton",
    "ProximalPoint": "newton.proximal_point",
}
"""Module of each solver that is mainly a part of ``Robust``, and listed separately."""

PEERS = {
    "PinocchioADMM": "peers.pinocchio_admm",
    "PinocchioPGS": "peers.pinocchio_pgs",
    "KaminoPADMM": "peers.kamino_padmm",
    "MuJoCo": "peers.mujoco_constraints",
}
"""Module of each external solver, whose library is an optional dependency."""

ON_DEVICES = {"WarpJORprox": "prox.warp_sorprox", "WarpColouredSORprox": "prox.warp_sorprox"}
"""Module of each solver that needs Warp, an optional dependency, and one of its devices."""

_COMPOSITES = {"Refined": "composite.refined", "Fallback": "composite.fallback", "Warm": "composite.warm"}
"""Module of each solver that is composed of other solvers."""

_NATIVE = {"Shared": "native.shared_library", "Executable": "native.executable"}
"""Module of each solver in another programming language."""

_OWN = {**BUILT_IN, **PARTS, **_COMPOSITES, **PEERS, **ON_DEVICES, **_NATIVE}
"""Names that plugins cannot use."""

_EXAMPLES = {
    "Refined": "Refined(ClarabelCoulomb)",
    "Fallback": "Fallback(SORprox, NSGS)",
    "Warm": "Warm(SORprox)",
}

_NATIVE_EXAMPLES = {"Shared": "Shared(./libmine.so)", "Executable": "Executable(./mine)"}

_PATH = re.compile(rf"\b({'|'.join(_NATIVE)})\(\s*(?:'([^']*)'|\"([^\"]*)\"|([^'\"=,()]+?))\s*(?=[,)])")
"""Pattern of the path of a library or executable, which is the first argument, with or without quotes."""


def available() -> list[str]:
    """Return the names of built-in solvers, of parts of ``Robust``, and of plugins, without importing the plugins."""
    return [*BUILT_IN, *PARTS, *(offer.name for offer in plugin_solvers() if not offer.rejection)]


def parts() -> list[str]:
    """Return the names of solvers that are mainly parts of ``Robust``."""
    return list(PARTS)


def compiled_solvers(name: str | None = None) -> list[str]:
    """Return the plain names of built-in solvers with compiled kernels, or of those among ``name`` and its parts.

    Without ``name``, the solvers of ``parts`` are omitted. ``CvxpyCoulomb`` is always omitted because its library takes
    long to import.

    Raises:
        SolverError: if the text is not a name.
    """
    with_kernels = [solver for solver, module in {**BUILT_IN, **PARTS}.items() if "cvxpy" not in module]
    if name is None:
        return [solver for solver in with_kernels if solver in BUILT_IN]
    return [solver for solver in plain_names(name) if solver in with_kernels]


def peers() -> list[str]:
    """Return the names of external solvers; ``create`` raises ``SolverError`` if a library is not installed."""
    return list(PEERS)


def on_devices() -> list[str]:
    """Return the names of solvers on Warp devices; ``create`` raises ``SolverError`` without Warp or the device."""
    return list(ON_DEVICES)


def composites() -> dict[str, str]:
    """Return an example of each built-in solver that is composed of other solvers, by its name."""
    return dict(_EXAMPLES)


def natives() -> dict[str, str]:
    """Return an example of each solver in another programming language, by its name."""
    return dict(_NATIVE_EXAMPLES)


def plugin_solvers() -> list[Offer]:
    """Return the solvers that plugins offer, including rejected offers with the reason."""
    return offers("solver", _OWN)


def is_built_in(name: str) -> bool:
    """Whether a plain name is reserved for a solver of Proxbench."""
    return name in _OWN


def create(name: str, **options: Any) -> Solver:
    """Return a solver: ``create("SORprox", relaxation=1.5)`` or ``create("SORprox(relaxation=1.5)")``.

    The parts of a composite solver come first: ``create("Fallback(SORprox(relaxation=1.5), NSGS)")``.

    Raises:
        SolverError: if a name or an option is unknown (the message suggests the nearest one), an option is out of
            range, or the parts are unsuitable.
        PluginError: if the plugin that offers the name cannot be imported, or its solver does not implement the
            interface.
    """
    written = parse(name)
    return _make(Name(written.plain, {**written.options, **options}, written.parts))


def _make(written: Name) -> Solver:
    plain, options = written.plain, written.options
    parts = [_make(part) for part in written.parts]
    if plain in _COMPOSITES:
        return _make_composite(plain, parts, options)
    offer = None if plain in _OWN else _offer(plain)
    if parts:
        raise SolverError(f"{plain} has no parts; give its options by name, not as in {written}.")
    make: Callable[..., Solver] = _built_in(plain) if offer is None else _plugin_factory(offer)
    check_options(plain, options, inspect.signature(make).parameters, SolverError)
    if offer is not None:
        return contract.make_solver(plain, offer.source, make, dict(options))
    try:
        return make(**options)
    except SolverError as error:
        is_named = plain in str(error) or plain in natives()
        raise SolverError(str(error) if is_named else f"{plain}: {error}") from None


def _make_composite(plain: str, parts: list[Solver], options: Mapping[str, Any]) -> Solver:
    make = _built_in(plain)
    signature = inspect.signature(make)
    known = [name for name, option in signature.parameters.items() if option.kind is option.KEYWORD_ONLY]
    check_options(plain, options, known, SolverError)
    try:
        signature.bind(*parts, **options)
    except TypeError:
        parts = []
    if not parts:
        raise SolverError(f"{plain} needs other solvers as its parts; name them as in {_EXAMPLES[plain]}.")
    warm = next((part.name for part in parts if starts_from_last_answer(part)), "")
    if warm:
        raise SolverError(f"{plain} cannot contain {warm}, whose start a run provides; make {plain} a part of Warm.")
    return make(*parts, **options)


def factory(name: str) -> Any:
    """Return the class of a solver, or the factory that a plugin offers, by its plain name.

    Raises:
        SolverError: if the name is unknown; the message suggests the nearest one.
        PluginError: if the plugin that offers the name cannot be imported.
    """
    return _built_in(name) if name in _OWN else _plugin_factory(_offer(name))


def find_offer(name: str) -> Offer | None:
    """Return the plugin's offer of the solver ``name`` or of its first part from a plugin; None if all are built in.

    Raises:
        SolverError: if the name is unknown; the message suggests the nearest one.
    """
    plugin_offers = [_offer(plain) for plain in plain_names(name) if plain not in _OWN]
    return plugin_offers[0] if plugin_offers else None


def plain_names(name: str) -> list[str]:
    """Return the plain names of a solver and of its parts, in order.

    Raises:
        SolverError: if the text is not a name.
    """

    def names(written: Name) -> list[str]:
        return [written.plain, *(plain for part in written.parts for plain in names(part))]

    return names(parse(name))


def native_parts(name: str) -> list[str]:
    """Return the names of a solver and its parts that are in another programming language, each with its options.

    Raises:
        SolverError: if the text is not a name.
    """

    def native_names(written: Name) -> list[str]:
        names = [_native_text(written)] if written.plain in _NATIVE else []
        return names + [name for part in written.parts for name in native_names(part)]

    return native_names(parse(name))


def _native_text(written: Name) -> str:
    """Return the name of a solver in another programming language as the solver itself writes it."""
    options = {key: value for key, value in written.options.items() if key != "path"}
    first = [repr(written.options["path"])] if "path" in written.options else []
    return f"{written.plain}({', '.join([*first, *(f'{key}={value!r}' for key, value in options.items())])})"


def _built_in(name: str) -> Callable[..., Solver]:
    make: Callable[..., Solver] = getattr(import_module(f".{_OWN[name]}", __package__), name)
    return make


def _offer(name: str) -> Offer:
    plugin_offers = plugin_solvers()
    for offer in plugin_offers:
        if offer.name == name:
            return offer
    usable = [offer.name for offer in plugin_offers if not offer.rejection]
    raise SolverError(f"there is no solver {name!r}{suggestion(name, [*_OWN, *usable], 'proxbench list solvers')}")


def _plugin_factory(offer: Offer) -> Any:
    make = offer.load()
    contract.check_factory(offer.name, offer.source, make)
    return make


def parse(text: str) -> Name:
    """Parse a name such as ``"SORprox(relaxation=1.5)"``; values are Python literals.

    The path of a library or executable needs no quotes: ``"Shared(./libmine.so)"``.

    Raises:
        SolverError: if the text is neither a name nor a name with keyword options.
    """
    given: object = text
    if not isinstance(given, str):
        raise SolverError(f"a solver has a name, such as 'SORprox', not a value of type {type(text).__name__}.")
    named = _PATH.sub(lambda match: f"{match[1]}(path={match[2] or match[3] or match[4] or ''!r}", text)
    return read_name(named, "solver", "SORprox(relaxation=1.5)", SolverError)


@interprets_kernels
def solve(
    problem: ContactProblem | str | Path, solver: str | Solver = "Robust", tolerance: float = 1e-6, **limits: Any
) -> Solution:
    """Solve one problem: ``solve(problem, tolerance=1e-6)``, or ``solve(problem, "SORprox")``.

    Args:
        problem: the contact problem, its name, or the path of its file.
        solver: a solver, or its name; ``Robust`` sweeps while that is fast, and continues with other methods.
        tolerance: the judge's residual to reach.
        limits: ``max_iterations`` and ``max_seconds``.

    Returns:
        The solution; its status is unsupported if the solver cannot solve the problem.

    Raises:
        SolverError: if the solver, an option or a limit is unknown, ``solver`` does not implement the interface, or
            ``problem`` is not a contact problem, a name or a path.
        ProblemError: if the problem cannot be loaded.
        InsufficientMemoryError: if the available memory does not suffice for the solver's matrices.
    """
    check_limit_names("solve", limits)
    if isinstance(problem, str | Path):
        problem = load(problem)
    if not isinstance(problem, ContactProblem):
        raise SolverError(f"problem must be a ContactProblem, a name or a path, not {type(problem).__name__}.")
    method = create(solver) if isinstance(solver, str) else solver
    if not isinstance(solver, str):
        _check_contract(method, contract.form_fault(method))
    stop, reason = Stop(tolerance, **limits), method.supports(problem)
    _check_contract(method, contract.reason_fault(reason))
    if reason:
        return Solution(np.zeros(problem.n_rows), Status.UNSUPPORTED, 0, reason)
    prepared = method.prepare(problem)
    _check_contract(method, contract.prepared_fault(prepared))
    solution = prepared.solve(stop)
    _check_contract(method, contract.solution_fault(problem, solution))
    return solution


def _check_contract(solver: object, fault: str | None) -> None:
    """Raise ``SolverError`` if a solver does not implement the solver interface."""
    if isinstance(solver, type):
        raise SolverError(f"the solver {solver.__name__} is a class; pass an instance, {solver.__name__}().")
    if fault is not None:
        raise SolverError(f"the solver {type(solver).__name__} does not implement the solver interface: {fault}.")
