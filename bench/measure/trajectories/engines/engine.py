"""Engines by name, with their drivers, tested versions and compared settings."""

from dataclasses import dataclass
from importlib import import_module, metadata
from typing import Any, Protocol

from .....problems.errors import suggestion
from ....errors import BenchError
from .description import BodyStates, Description, Setting
from .solved_problem import SolvedProblem

INSTALL = 'pip install ".[engines]" in a clone of proxbench'
"""Command that installs the engines."""


class Engine(Protocol):
    """A scene built in an engine, by the function ``build(description, time_step, options)`` of its module."""

    def step(self) -> None:
        """Advance by one step."""

    def states(self) -> BodyStates:
        """Return the states of all bodies."""

    def store_state(self) -> None:
        """Store the state before a step whose contact problem is requested."""

    def solved_problem(self) -> SolvedProblem | None:
        """Return the contact problem of the last step; None without contacts, or if the engine reports no impulses."""


@dataclass(frozen=True)
class EngineKind:
    """An engine of the comparison.

    Attributes:
        module: name of its driver, a module of this package.
        distribution: name of the distribution whose version is stored.
        tested_version: beginning of the versions with which the driver was tested; empty for any version.
        settings: the settings that are compared.
        model: how the model of the engine differs from rigid bodies with Coulomb friction, for tables.
    """

    module: str
    distribution: str
    tested_version: str
    settings: tuple[Setting, ...]
    model: str


def _setting(name: str, step_factor: float = 1.0, **options: Any) -> Setting:
    return Setting(name, step_factor, options)


_STIFF: dict[str, Any] = {"cone": "elliptic", "impratio": 10, "stiff": True}
"""Options of MuJoCo for nearly rigid contacts."""

ENGINES: dict[str, EngineKind] = {
    "mujoco": EngineKind(
        "mujoco_engine",
        "mujoco",
        "4.0",
        (
            _setting("default"),
            _setting("elliptic", cone="elliptic"),
            _setting("elliptic, impratio 100", cone="elliptic", impratio=100),
            _setting("stiff", **_STIFF),
            _setting("stiff, CG", solver="CG", **_STIFF),
            _setting("stiff, half step", 0.5, **_STIFF),
            _setting("stiff, long step", 2.5, **_STIFF),
        ),
        "soft convex contacts, no gaps closed within a step; *stiff*: time constant of two steps, impratio 10",
    ),
    "pybullet": EngineKind(
        "pybullet_engine",
        "pybullet",
        "3.2",
        (
            _setting("10 iterations", iterations=10),
            _setting("50 iterations", iterations=50),
            _setting("200 iterations", iterations=200),
            _setting("50 iterations, half step", 0.5, iterations=50),
            _setting("50 iterations, long step", 2.5, iterations=50),
        ),
        "sequential impulses, friction in a pyramid, a part of each penetration corrected by impulses",
    ),
    "rapier": EngineKind(
        "rapier_engine",
        "rapier3d",
        "0.36",
        (
            _setting("default"),
            _setting("16 iterations", iterations=16),
            _setting("Coulomb", friction_model="COULOMB"),
            _setting("Coulomb, half step", 0.5, friction_model="COULOMB"),
            _setting("default, long step", 2.5),
        ),
        "single precision, soft contacts in substeps (iterations); default friction acts once a contact patch",
    ),
    "dart": EngineKind(
        "dart_engine",
        "dartpy",
        "6.20",
        (
            _setting("default", detector="FCL"),
            _setting("ODE contacts", detector="ODE"),
            _setting("ODE contacts, sweeps", detector="ODE", sweeps=100),
            _setting("ODE contacts, NSGS", detector="ODE", nsgs=True),
            _setting("ODE contacts, half step", 0.5, detector="ODE"),
            _setting("ODE contacts, long step", 2.5, detector="ODE"),
        ),
        "exact solver, friction in a pyramid (*NSGS*: Coulomb), a part of each penetration corrected by impulses",
    ),
    "proxbench": EngineKind(
        "own_engine",
        "proxbench",
        "",
        (
            _setting("1e-2", tolerance=1e-2),
            _setting("1e-4", tolerance=1e-4),
            _setting("1e-8", tolerance=1e-8),
            _setting("1e-4, half step", 0.5, tolerance=1e-4),
            _setting("1e-2, long step", 2.5, tolerance=1e-2),
            _setting("1e-8, long step", 2.5, tolerance=1e-8),
        ),
        "Moreau's rule, positions of balls projected; a round funnel; tolerance of each step",
    ),
}
"""Engines by name."""


def version_of(name: str) -> str:
    """Return the version of an engine.

    Raises:
        BenchError: if the engine is unknown, not installed, or was not tested in this version.
    """
    if name not in ENGINES:
        raise BenchError(f"there is no engine {name!r}{suggestion(name, ENGINES)}")
    kind = ENGINES[name]
    remedy = f"run {INSTALL}, or choose others with --engine"
    try:
        version = metadata.version(kind.distribution)
    except metadata.PackageNotFoundError:
        raise BenchError(f"the engine {name} is not installed; {remedy}.") from None
    if kind.tested_version and not version.startswith(f"{kind.tested_version}."):
        raise BenchError(
            f"the engine {name} {version} is not supported; versions {kind.tested_version}.x are; {remedy}."
        )
    return version


def build(name: str, description: Description, setting: Setting) -> Engine:
    """Build a scene in an engine."""
    driver = import_module(f".{ENGINES[name].module}", __package__)
    engine: Engine = driver.build(description, description.step * setting.step_factor, setting.options)
    return engine
