"""Problems of the suite ``bodies``: steps of scenes of rigid bodies.

Most of them are the first step of a scene, and need no solver. The others are later steps, and a solver solves the
steps before them. The captured step itself is not solved.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Protocol

from ....problems.contact.problem import FREE_FALL, ContactProblem
from ....problems.contact.solver import Stop
from ....problems.errors import ProblemError
from ....problems.exchange.catalog import ARCH_STONES
from ....problems.motion.bodies.rigid.rigid_bodies import RigidBodies
from ....problems.motion.scenes.funnel import STANDARD_GRAVITY
from ....problems.motion.scenes.rigid.arch import Arch
from ....problems.motion.scenes.rigid.boxes import BoxOnIncline, BoxStack, ThrownBox, TippingBox
from ....problems.motion.scenes.rigid.card_house import CardHouse
from ....problems.motion.scenes.rigid.containers import RotatingDrum
from ....problems.motion.scenes.rigid.linkages import BallOnChain, Chain, FourBar, Pendulum
from ....problems.motion.scenes.rigid.rolling import RollingCylinder, RollingSphere
from ....problems.motion.scenes.rigid.spinning_top import SpinningTop
from ....problems.motion.scenes.rigid.walls import BrickWall
from ....problems.motion.scenes.scene import OVERLAP
from ....problems.motion.state import State
from ....problems.motion.stepping.midpoint import MidpointRule, step_problem
from ....solvers.registry import create
from .box_scenes import BoxPile, BoxTable, BoxTrain

SETTLING_SOLVER = "SORprox(relaxation=1.3)"
"""Solver of the steps in which boxes settle or slump."""

SETTLING_STOP = Stop(tolerance=1e-4, max_iterations=50)
"""Solver limits while boxes settle. Only their final positions matter, and their contacts are redundant."""

JOINT_STOP = Stop(tolerance=1e-10, max_iterations=10_000)
"""Solver limits while a linkage moves."""


class BodyScene(Protocol):
    """A scene of rigid bodies."""

    def system(self) -> RigidBodies:
        """Return the bodies."""
        ...

    def start(self) -> State:
        """Return the state at time 0."""
        ...


@dataclass(frozen=True)
class BodyRecipe:
    """The contact problem of a step of a scene.

    Attributes:
        scene: the scene.
        step: number of steps before the captured one.
        time_step: Δt [s].
        solver: solver of these steps.
        stop: stopping criterion of the solver.
        depth: penetration [m] beyond which bodies are moved apart after each of these steps; None for no limit.
    """

    scene: BodyScene
    step: int = 0
    time_step: float = 1e-3
    solver: str = "Robust"
    stop: Stop = JOINT_STOP
    depth: float | None = None


ARCH_LIMITS = dict(zip(ARCH_STONES, (0.0962, 0.1021, 0.1028, 0.1068, 0.1074), strict=True))
"""Smallest t/R at which an arch of each number of stones stands at μ = 0.8; see ``scenes.rigid.arch``."""


def _pile(n_boxes: int, step: int = 500) -> BodyRecipe:
    """Return the recipe of a step of a pile of boxes."""
    return BodyRecipe(BoxPile(n_boxes), step, 2e-3, SETTLING_SOLVER, SETTLING_STOP, 1e-4)


def _named_recipes() -> Iterator[tuple[str, BodyRecipe]]:
    """Yield the name and the recipe of each problem."""
    scenes: dict[str, BodyScene] = {
        "stack-10": BoxStack(10, overlap=OVERLAP),
        "stack-100": BoxStack(100, overlap=OVERLAP),
        "cards-1": CardHouse(1),
        "cards-3": CardHouse(3),
        "cards-6": CardHouse(6),
        "cards-3-slipping": CardHouse(3, friction=0.1),
        "box-thrown": ThrownBox(overlap=OVERLAP),
        "box-sticking": BoxOnIncline(slope=0.3, overlap=OVERLAP),
        "box-sliding": BoxOnIncline(slope=0.5, overlap=OVERLAP),
        "box-tipping": TippingBox(),
        "sphere-rolling": RollingSphere(),
        "cylinder-rolling": RollingCylinder(),
        "top-on-tip": SpinningTop(friction=0.3),
        "pendulum": Pendulum(),
        "four-bar": FourBar(),
        "ball-on-chain-1e4": BallOnChain(angle=0.5),
        "train-10": BoxTrain(10),
        "train-10-1e4": BoxTrain(10, 1e4),
        "train-300": BoxTrain(300),
        "table-2": BoxTable(2),
        "table-4": BoxTable(4),
        "table-4-1e4": BoxTable(4, 1e4),
        "table-10": BoxTable(10),
        "table-25": BoxTable(25),
        "arch-13-sliding": Arch(13, 0.2, friction=0.3),
        "wall": BrickWall(speed=0.0),
    }
    for ratio in ("1e2", "1e4", "1e6"):
        scenes[f"stack-10-bottom-{ratio}"] = BoxStack(10, float(ratio), overlap=OVERLAP)
        scenes[f"stack-10-top-{ratio}"] = BoxStack(10, float(ratio), heavy_on_top=True, overlap=OVERLAP)
    for stones, limit in ARCH_LIMITS.items():
        scenes[f"arch-{stones}-thick"] = Arch(stones, 1.05 * limit)
        scenes[f"arch-{stones}-thin"] = Arch(stones, 0.95 * limit)
    for name, scene in scenes.items():
        yield f"bodies-{name}", BodyRecipe(scene)
    for links in (20, 200):
        yield f"bodies-chain-{links}", BodyRecipe(Chain(links), step=100)
    yield "bodies-wall-struck", BodyRecipe(BrickWall(), step=2)
    for drum in (RotatingDrum(24, layers=1), RotatingDrum(48)):
        name = f"bodies-drum-{drum.n_boxes}"
        yield name, BodyRecipe(drum, 250, drum.step_size, SETTLING_SOLVER, SETTLING_STOP, drum.depth)
    for n_boxes in (100, 300, 1000):
        yield f"bodies-pile-{n_boxes}", _pile(n_boxes)
    yield "bodies-pile-100-falling", _pile(100, step=75)


@cache
def body_recipes() -> dict[str, BodyRecipe]:
    """Return the recipe of each problem of the suite ``bodies``. The scenes are created at the first call."""
    return dict(_named_recipes())


def body_problem(name: str) -> ContactProblem:
    """Return the problem of the recipe called ``name``.

    Raises:
        ProblemError: if no contact is active in the step.
    """
    recipe = body_recipes()[name]
    stepper = MidpointRule(
        recipe.scene.system(), create(recipe.solver), recipe.stop, recipe.time_step, depth=recipe.depth
    )
    state = recipe.scene.start()
    for step in stepper.steps(state, recipe.step):
        state = step.state
    midpoint = stepper.system.move(state.position, state.velocity, 0.5 * recipe.time_step)
    assembly = stepper.system.assemble(midpoint, state.velocity, recipe.time_step)
    if assembly.contacts is None:
        raise ProblemError(f"no contact is active in step {recipe.step} of the scene of {name!r}.")
    problem = step_problem(assembly, assembly.contacts, state.velocity)
    free_fall = STANDARD_GRAVITY * recipe.time_step
    return problem.renamed(name, scene=type(recipe.scene).__name__, step=recipe.step, **{FREE_FALL: free_fall})
