"""What is solved: contact problems, their force laws, the judge, scenes and time stepping."""

from .answer import Answer
from .catalog import load, suite
from .contact import ContactProblem
from .errors import PluginError, ProblemError, ProxbenchError
from .judge import Verdict, judge
from .laws import LawKind, Laws
from .model import Model
from .projections import project

__all__ = [
    "Answer",
    "ContactProblem",
    "LawKind",
    "Laws",
    "Model",
    "PluginError",
    "ProblemError",
    "ProxbenchError",
    "Verdict",
    "judge",
    "load",
    "project",
    "suite",
]
