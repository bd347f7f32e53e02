"""The list of solvers, those of plugins included, and how a name with options becomes one."""

import inspect
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from ..problems.contact.problem import ContactProblem
from ..problems.contact.solver import Solution, Solver, SolverError, Status, Stop
from ..problems.errors import suggestion
from ..problems.exchange.catalog import load
from ..problems.exchange.plugins import Offer, offers
from ..problems.names import Name, check_options, read_name
from . import contract

BUILT_IN = {
    "Robust": "composite.robust",
    "Jprox": "prox.jprox",
    "JORprox": "prox.jorprox",
    "SORprox": "prox.sorprox",
    "SafeguardedSORprox": "prox.safeguarded_sorprox",
    "AdaptiveSORprox": "prox.adaptive_sorprox",
    "NesterovSORprox": "prox.nesterov_sorprox",
    "AndersonSORprox": "prox.anderson_sorprox",
    "NSGS": "prox.nsgs",
    "SemismoothNewton": "newton.semismooth_newton",
    "ProximalADMM": "prox.proximal_admm",
    "FBF": "prox.fbf",
    "TrescaFixedPoint": "prox.tresca_fixed_point",
    "APGD": "prox.apgd",
    "SAP": "newton.sap",
    "ProximalPoint": "newton.proximal_point",
    "InteriorPoint": "interior.interior_point",
    "CentralPath": "interior.central_path",
    "HybridNewton": "composite.hybrid_newton",
    "InteriorNewton": "composite.interior_newton",
    "MomentumFallback": "composite.momentum_fallback",
    "ClarabelSOCP": "conic.clarabel_socp",
    "ClarabelCoulomb": "conic.clarabel_coulomb",
    "CvxpySOCP": "conic.cvxpy_solvers",
    "CvxpyCoulomb": "conic.cvxpy_solvers",
    "CvxpyQP": "conic.cvxpy_solvers",
    "Lemke": "lcp.lemke",
    "PyramidPGS": "lcp.projected_gauss_seidel",
    "Enumeration": "lcp.enumeration",
}
"""Module of each built-in solver, imported when the solver is created."""

PEERS = {"PinocchioADMM": "peers.pinocchio_admm", "PinocchioPGS": "peers.pinocchio_pgs"}
"""The same of solvers of others, whose libraries are installed apart."""

_COMPOSITES = {"Refined": "composite.refined", "Fallback": "composite.fallback"}
"""The same of solvers that are made of those named as their parts."""

_OWN = {**BUILT_IN, **_COMPOSITES, **PEERS}
"""Names that no plugin can take."""

_EXAMPLES = {"Refined": "Refined(ClarabelCoulomb)", "Fallback": "Fallback(SORprox, NSGS)"}


def available() -> list[str]:
    """Return the names of built-in solvers, then of those of plugins, which are not imported yet."""
    return [*BUILT_IN, *(offer.name for offer in plugin_solvers() if not offer.refusal)]


def peers() -> list[str]:
    """Return the names of the solvers of others, which ``create`` knows; whether their libraries are there it says."""
    return list(PEERS)


def composites() -> dict[str, str]:
    """Return an example of each built-in solver that is made of others, by its name."""
    return dict(_EXAMPLES)


def plugin_solvers() -> list[Offer]:
    """Return what plugins offer as solvers, the refused ones with their reason."""
    return offers("solver", _OWN)


def create(name: str, **options: Any) -> Solver:
    """Return a solver: ``create("SORprox", relaxation=1.5)`` or ``create("SORprox(relaxation=1.5)")``.

    A solver that is made of others names them first: ``create("Fallback(SORprox(relaxation=1.5), NSGS)")``.

    Raises:
        SolverError: for an unknown name or option (with the nearest known one), an option out of range, or parts that
            do not fit.
        PluginError: if a plugin offers the name but does not import, or its solver breaks the contract.
    """
    written = parse(name)
    return _made(Name(written.plain, {**written.options, **options}, written.parts))


def _made(written: Name) -> Solver:
    plain, options = written.plain, written.options
    parts = [_made(part) for part in written.parts]
    if plain in _COMPOSITES:
        return _composed(plain, parts, options)
    offer = None if plain in _OWN else _offer(plain)
    if parts:
        raise SolverError(f"{plain} is not made of other solvers; write its options by name, not {written}.")
    make = _built_in(plain) if offer is None else _plugin_factory(offer)
    check_options(plain, options, inspect.signature(make).parameters, SolverError)
    solver: Solver = make(**options) if offer is None else contract.made(plain, offer.source, make, dict(options))
    return solver


def _composed(plain: str, parts: list[Solver], options: Mapping[str, Any]) -> Solver:
    make = _built_in(plain)
    signature = inspect.signature(make)
    known = [name for name, one in signature.parameters.items() if one.kind is one.KEYWORD_ONLY]
    check_options(plain, options, known, SolverError)
    try:
        signature.bind(*parts, **options)
    except TypeError:
        parts = []
    if not parts:
        raise SolverError(f"{plain} is made of other solvers; name them as in {_EXAMPLES[plain]}.")
    solver: Solver = make(*parts, **options)
    return solver


def factory(name: str) -> Any:
    """Return the class of a solver by its plain name.

    Raises:
        SolverError: for an unknown name, with the nearest one.
        PluginError: if a plugin offers the name but does not import.
    """
    return _built_in(name) if name in _OWN else _plugin_factory(_offer(name))


def find(name: str) -> Offer | None:
    """Return what a plugin offers of the solver ``name``, itself or a part of it; None if all of it is built in.

    Raises:
        SolverError: for an unknown name, with the nearest one.
    """
    found = [_offer(plain) for plain in plain_names(name) if plain not in _OWN]
    return found[0] if found else None


def plain_names(name: str) -> list[str]:
    """Return the plain names of a solver and of its parts, in the order in which they are written.

    Raises:
        SolverError: if the text is not a name.
    """

    def names(written: Name) -> list[str]:
        return [written.plain, *(plain for part in written.parts for plain in names(part))]

    return names(parse(name))


def _built_in(name: str) -> Any:
    return getattr(import_module(f".{_OWN[name]}", __package__), name)


def _offer(name: str) -> Offer:
    found = plugin_solvers()
    for offer in found:
        if offer.name == name:
            return offer
    usable = [offer.name for offer in found if not offer.refusal]
    raise SolverError(f"there is no solver {name!r}{suggestion(name, [*_OWN, *usable], 'proxbench list solvers')}")


def _plugin_factory(offer: Offer) -> Any:
    make = offer.load()
    contract.check_factory(offer.name, offer.source, make)
    return make


def parse(text: str) -> Name:
    """Return the name that ``"SORprox(relaxation=1.5)"`` writes; values are Python literals.

    Raises:
        SolverError: if the text is not a name, or a name with keyword options.
    """
    return read_name(text, "solver", "SORprox(relaxation=1.5)", SolverError)


def solve(
    problem: ContactProblem | str | Path, solver: str | Solver = "Robust", tolerance: float = 1e-6, **limits: Any
) -> Solution:
    """Solve one problem: ``solve(problem, tolerance=1e-6)``, or ``solve(problem, "SORprox")``.

    Args:
        problem: the contact problem, or what ``load`` takes: its name, or the path of its file.
        solver: a solver, or its name; ``Robust`` sweeps while that is fast, and goes on with other methods.
        tolerance: the judge's residual to reach.
        limits: max_iterations, max_seconds.

    Raises:
        SolverError: for an unknown solver or option, or what is no problem.
        ProblemError: from ``load``.
    """
    if isinstance(problem, str | Path):
        problem = load(problem)
    if not isinstance(problem, ContactProblem):
        raise SolverError(f"a problem is a ContactProblem or its name, not {type(problem).__name__}.")
    method = create(solver) if isinstance(solver, str) else solver
    reason = method.supports(problem)
    if reason:
        return Solution(0.0 * problem.free_velocity, Status.UNSUPPORTED, 0, reason)
    return method.prepare(problem).solve(Stop(tolerance, **limits))
