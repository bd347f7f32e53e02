"""Contact problems, their force laws, the judge, scenes and time stepping."""

from . import compilation as _compilation  # noqa: F401  before the first kernel is defined
from .capture.step import from_mujoco
from .contact.answer import Answer
from .contact.judge import Verdict, judge
from .contact.laws import LawKind, Laws
from .contact.model import Model
from .contact.problem import ContactProblem
from .contact.projections import project
from .errors import InsufficientMemoryError, PluginError, ProblemError, ProxbenchError
from .exchange.catalog import load, suite
from .exchange.fclib.files import read_fclib, write_fclib
from .exchange.files.problem_file import save_problem

__all__ = [
    "Answer",
    "ContactProblem",
    "InsufficientMemoryError",
    "LawKind",
    "Laws",
    "Model",
    "PluginError",
    "ProblemError",
    "ProxbenchError",
    "Verdict",
    "from_mujoco",
    "judge",
    "load",
    "project",
    "read_fclib",
    "save_problem",
    "suite",
    "write_fclib",
]
