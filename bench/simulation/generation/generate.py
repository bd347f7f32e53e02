"""Generate the problems of the standard suites from their scenes.

A recipe specifies the step of a simulation that gives a problem. On one machine, scenes are deterministic for a given
seed, so that generating a problem twice gives equal digests. Rounding differs between machines, so runs use the frozen
library.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, islice
from pathlib import Path
from typing import Any

from ....problems.contact.problem import FREE_FALL, ContactProblem
from ....problems.contact.solver import Stop
from ....problems.errors import LIST_PROBLEMS_COMMAND, ProblemError, suggestion
from ....problems.exchange.catalog import (
    FUNNEL_SIZES,
    MIXED_PILES,
    PILE_SIZES,
    SEQUENCE_MEMBERS,
    cache_folder,
    is_available,
    plugin_problems,
    problem_names,
)
from ....problems.exchange.files.problem_file import SUFFIX, check_folder, save_problem
from ....problems.hard import HARD_CASES
from ....problems.hard.spheres import with_rolling_friction
from ....problems.motion.bodies.mixed_friction import MixedFriction
from ....problems.motion.scenes.effects import Effect, Friction, Gravity, Planar, Restitution
from ....problems.motion.scenes.funnel import STANDARD_GRAVITY, TIME_STEP, Funnel
from ....problems.motion.scenes.woodpecker import PERIOD, section_start, woodpecker
from ....problems.motion.stepping.midpoint import MidpointRule
from ....problems.motion.stepping.step import Step
from ....solvers.registry import create
from ...plugins.descriptions import plugin_problem
from .body_problems import BodyRecipe, body_problem, body_recipes
from .sequence_problems import SEQUENCE_OF_PROBLEM, SEQUENCE_RECIPES, SequenceRecipe, sequence_problems

WOODPECKER_STEPS = 5000
"""Fixed steps in one period of the woodpecker."""

FLOW_STOP = Stop(tolerance=1e-12, max_iterations=2000)
"""Solver limits while balls flow. Impacts amplify errors by many orders of magnitude, so each step is
solved nearly to rounding."""

PILE_STOP = Stop(tolerance=1e-4, max_iterations=300)
"""Solver limits while balls settle: the contacts of a pile are redundant, and sweeps stagnate near 1e-4."""


@dataclass(frozen=True)
class FunnelRecipe:
    """The step of a funnel scene that begins at ``time`` [s].

    With ``mixed_friction``, each pair of bodies has a random μ in this range, drawn with the seed of the scene.
    """

    scene: Funnel
    time: float
    stop: Stop = FLOW_STOP
    mixed_friction: tuple[float, float] | None = None


@dataclass(frozen=True)
class WoodpeckerRecipe:
    """The first step at or after ``time`` [s] in which ``contact`` (0 beak, 1 lower edge, 2 upper edge) is active."""

    time: float
    contact: int


@dataclass(frozen=True)
class RollingRecipe:
    """The named ``problem`` with the additional ``rolling_friction`` μ_r [m] at all contacts."""

    problem: str
    rolling_friction: float


_FRICTIONLESS: tuple[Effect, ...] = (Gravity(), Restitution(0.3, 0.0))
_SPATIAL: tuple[Effect, ...] = (*_FRICTIONLESS, Friction(0.3))
_PLANAR: tuple[Effect, ...] = (*_SPATIAL, Planar())

_FUNNEL_TIMES = {30: (0.16, 0.45, 0.65), 100: (0.12, 0.32, 0.6), 300: (0.12, 0.29, 0.6), 1000: (0.12, 0.3, 0.8)}
"""Times of the first impacts, the densest flow and the thinning flow [s], for each number of balls."""

_OUTLETS = {30: 0.0, 100: 3.0, 300: 4.5, 1000: 4.5}
"""Outlet radius in ball radii: few balls would fall through the wide outlet before they pile up over it."""

_SETTLED_SECONDS = 2.0
"""Time at which a pile has settled [s]."""

MIXED = (0.1, 0.95)
"""Range of friction coefficients of the mixed piles."""


def _funnel_recipes() -> Iterator[tuple[str, FunnelRecipe]]:
    for size in FUNNEL_SIZES:
        early, dense, late = _FUNNEL_TIMES[size]
        spatial = Funnel(size, _SPATIAL, _OUTLETS[size])
        for suffix, time in (("-early", early), ("", dense), ("-late", late)):
            yield f"funnel-{size}{suffix}", FunnelRecipe(spatial, time)
        yield f"funnel-planar-{size}", FunnelRecipe(Funnel(size, _PLANAR, _OUTLETS[size]), dense)
        yield f"funnel-frictionless-{size}", FunnelRecipe(Funnel(size, _FRICTIONLESS, _OUTLETS[size]), dense)
    for size in PILE_SIZES:
        yield f"pile-{size}", FunnelRecipe(Funnel(size, _SPATIAL, outlet_radius=0.0), _SETTLED_SECONDS, PILE_STOP)
    for seed, name in enumerate(MIXED_PILES, start=1):
        scene = Funnel(400, _SPATIAL, outlet_radius=0.0, seed=seed)
        yield name, FunnelRecipe(scene, _SETTLED_SECONDS, PILE_STOP, MIXED)


Recipe = FunnelRecipe | WoodpeckerRecipe | RollingRecipe | BodyRecipe | SequenceRecipe
"""Recipe of a generated problem."""


@cache
def recipes() -> dict[str, Recipe]:
    """Return the recipe of each generated problem. The scenes are created at the first call."""
    return {
        **dict(_funnel_recipes()),
        **body_recipes(),
        **{member: SEQUENCE_RECIPES[name] for member, name in SEQUENCE_OF_PROBLEM.items()},
        "pile-100-rolling": RollingRecipe("pile-100", 1e-3),
        "woodpecker-lower-release": WoodpeckerRecipe(0.0058, 1),
        "woodpecker-upper-impact": WoodpeckerRecipe(0.0165, 2),
        "woodpecker-beak-impact": WoodpeckerRecipe(0.0195, 0),
        "woodpecker-upper-second-impact": WoodpeckerRecipe(0.0202, 2),
        "woodpecker-upper-release": WoodpeckerRecipe(0.0222, 2),
        "woodpecker-lower-impact": WoodpeckerRecipe(0.0570, 1),
        "woodpecker-lower-second-impact": WoodpeckerRecipe(0.0600, 1),
        "woodpecker-lower-slip-to-stick": WoodpeckerRecipe(0.10635, 1),
        "woodpecker-lower-stick-to-slip": WoodpeckerRecipe(0.1459, 1),
    }


def generate(names: Sequence[str], folder: Path | None = None) -> list[Path]:
    """Generate problems from their scenes and write them.

    Args:
        names: standard problems that come from scenes, and problems of plugins.
        folder: output folder; the user's cache folder if None.

    Returns:
        The files written, in the order of ``names``.

    Raises:
        ProblemError: for a name without a recipe, or a folder that cannot be written.
        PluginError: if a plugin does not create the problem that it offers.
    """
    plugin_names = {offer.name for offer in plugin_problems()}.difference(recipes(), HARD_CASES)
    for name in names:
        if name in HARD_CASES:
            raise ProblemError(
                f"{name!r} is built from its formula whenever it is loaded; there is nothing to generate."
            )
        if name not in recipes() and name not in plugin_names:
            raise ProblemError(
                f"there is no recipe for {name!r}{suggestion(name, problem_names(), LIST_PROBLEMS_COMMAND)}"
            )
    target = folder if folder is not None else cache_folder()
    check_folder(target)  # before simulations, which may take minutes
    new_plugin_problems = (plugin_problem(name) for name in names if name in plugin_names)
    for problem in chain(new_plugin_problems, remake_problems(name for name in names if name not in plugin_names)):
        save_problem(problem, target / f"{problem.name}{SUFFIX}")
    return [target / f"{name}{SUFFIX}" for name in names]


def generate_missing(names: Iterable[str]) -> None:
    """Generate missing problems that come from scenes, into the user's cache folder."""
    missing = [name for name in names if not is_available(name) and name in recipes()]
    if missing:
        generate(missing)


def remake_problems(names: Iterable[str]) -> Iterator[ContactProblem]:
    """Yield the named problems; problems of the same scene share one simulation.

    For a step of a sequence, also yield the steps before it, from which warm solvers start.
    """
    funnel_recipes: dict[tuple[Funnel, Stop, tuple[float, float] | None], dict[str, FunnelRecipe]] = {}
    woodpecker_recipes: dict[str, WoodpeckerRecipe] = {}
    sequences: dict[str, set[str]] = {}
    for name in names:
        recipe = recipes()[name]
        if isinstance(recipe, FunnelRecipe):
            funnel_recipes.setdefault((recipe.scene, recipe.stop, recipe.mixed_friction), {})[name] = recipe
        elif isinstance(recipe, WoodpeckerRecipe):
            woodpecker_recipes[name] = recipe
        elif isinstance(recipe, SequenceRecipe):
            sequences.setdefault(SEQUENCE_OF_PROBLEM[name], set()).add(name)
        elif isinstance(recipe, BodyRecipe):
            yield body_problem(name)
        else:
            yield from _rolling_problems(name, recipe)
    for (scene, stop, mixed), members in funnel_recipes.items():
        yield from _funnel_problems(scene, stop, mixed, members)
    if woodpecker_recipes:
        yield from _woodpecker_problems(woodpecker_recipes)
    for name, steps in sequences.items():
        yield from islice(sequence_problems(name), max(map(SEQUENCE_MEMBERS[name].index, steps)) + 1)


def _solver() -> Any:
    """Return the solver of funnel scenes."""
    return create("SORprox", relaxation=1.5)


def _funnel_problems(
    scene: Funnel, stop: Stop, mixed: tuple[float, float] | None, members: dict[str, FunnelRecipe]
) -> Iterator[ContactProblem]:
    """Yield the problems of the recipes ``members``, which share a scene, a stopping criterion and a range of μ."""
    step_numbers = {name: round(recipe.time / TIME_STEP) for name, recipe in members.items()}
    system = scene.system()
    if mixed is not None:
        system = replace(system, friction=MixedFriction(*mixed, scene.seed))
    stepper = MidpointRule(system, _solver(), stop, TIME_STEP)
    for number, step in enumerate(stepper.steps(scene.start(), max(step_numbers.values()) + 1)):
        for name in members:
            if step_numbers[name] == number:
                yield _step_problem(step, name, "funnel", number, TIME_STEP, seed=scene.seed, n_balls=scene.n_balls)


def _rolling_problems(name: str, recipe: RollingRecipe) -> Iterator[ContactProblem]:
    """Yield the problem of a recipe with rolling friction."""
    for problem in remake_problems([recipe.problem]):
        resisting = with_rolling_friction(problem, recipe.rolling_friction)
        yield resisting.renamed(name, rolling_friction=recipe.rolling_friction)


def _woodpecker_problems(members: dict[str, WoodpeckerRecipe]) -> Iterator[ContactProblem]:
    """Yield the problems of the recipes ``members`` from one simulation."""
    time_step = PERIOD / WOODPECKER_STEPS
    stepper = MidpointRule(woodpecker(), create("SORprox"), Stop(1e-12, 10_000), time_step)
    remaining = dict(members)
    for number, step in enumerate(stepper.steps(section_start(), 2 * WOODPECKER_STEPS)):
        if step.contacts is None:
            continue
        for name, recipe in list(remaining.items()):
            if number * time_step >= recipe.time and recipe.contact in step.contacts.keys:
                del remaining[name]
                yield _step_problem(step, name, "woodpecker", number, time_step)
        if not remaining:
            return


def _step_problem(step: Step, name: str, scene: str, number: int, time_step: float, **origin: int) -> ContactProblem:
    """Return the problem of a step with its name and origin; raise ``ProblemError`` if no contact is active."""
    if step.problem is None:
        raise ProblemError(f"no contact is active in step {number} of the scene of {name!r}.")
    free_fall = STANDARD_GRAVITY * time_step
    return step.problem.renamed(name, scene=scene, step=number, **origin, **{FREE_FALL: free_fall})
