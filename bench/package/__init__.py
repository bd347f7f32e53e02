"""Solve and judge frictional contact problems, and measure how well solvers solve them.

This folder is the package ``proxbench`` itself. Its names are imported on first use, so that ``import proxbench``
is fast.

``solve``
    Solve a problem: ``proxbench.solve("funnel-100")``.
``solve_many``
    Solve and judge many small problems in several threads.
``judge``
    Measure how far impulses are from solving a problem.
``load``
    Load a problem by name or from a file.
``run``
    Measure solvers on problems and store the run.
``ContactProblem``
    One contact problem, from the Delassus matrix or its factors.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .bench.runs import run
    from .problems.contact.judge import judge
    from .problems.contact.problem import ContactProblem
    from .problems.exchange.catalog import load
    from .solvers.composite.small.solve_many import solve_many
    from .solvers.registry import solve

    __version__: str

__all__ = ["ContactProblem", "__version__", "judge", "load", "run", "solve", "solve_many"]

_MODULES = {
    "ContactProblem": ".problems.contact.problem",
    "judge": ".problems.contact.judge",
    "load": ".problems.exchange.catalog",
    "run": ".bench.runs",
    "solve": ".solvers.registry",
    "solve_many": ".solvers.composite.small.solve_many",
}
"""Module that defines each name."""

_SUBPACKAGES = ("bench", "problems", "solvers")


def __dir__() -> list[str]:
    return sorted([*__all__, *_SUBPACKAGES])


if not TYPE_CHECKING:  # a type checker reports unknown names only if it finds no __getattr__

    def __getattr__(name: str) -> object:
        """Import a name on first use, and cache it."""
        if name in _SUBPACKAGES:
            return import_module(f".{name}", __name__)
        if name == "__version__":
            from importlib import metadata

            value = metadata.version("proxbench")
        elif name in _MODULES:
            value = getattr(import_module(_MODULES[name], __name__), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value
