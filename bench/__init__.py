"""Measure how well solvers solve problems; store, report and compare the runs."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .runs import Run, bundle, compare, load, merge, plot_convergence, rejudge, resume, run, study

__all__ = ["Run", "bundle", "compare", "load", "merge", "plot_convergence", "rejudge", "resume", "run", "study"]


def __getattr__(name: str) -> Any:
    """Import a name on first use: pandas and the solvers take a second to load."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import runs

    return getattr(runs, name)


def __dir__() -> list[str]:
    return sorted(__all__)
