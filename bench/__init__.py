"""How well problems are solved: measuring, storing and showing."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .runs import Run, bundle, compare, load, merge, plot_convergence, rejudge, resume, run, study

    __version__: str

__all__ = ["Run", "bundle", "compare", "load", "merge", "plot_convergence", "rejudge", "resume", "run", "study"]


def __getattr__(name: str) -> Any:
    """Import what is wanted when it is wanted: pandas and the solvers take a second to load."""
    if name == "__version__":
        from importlib import metadata

        return metadata.version("proxbench")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import runs

    return getattr(runs, name)
