"""How well problems are solved: measuring, storing and showing."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .measure.runner import resume, run
    from .store.frames import load

__all__ = ["load", "resume", "run"]

_HOMES = {"load": "store.frames", "resume": "measure.runner", "run": "measure.runner"}


def __getattr__(name: str) -> Any:
    """Import what is asked for when it is asked for: pandas and the solvers take a second to load."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
