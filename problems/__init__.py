"""What is solved: contact problems, their force laws, the judge, scenes and time stepping."""

from .answer import Answer
from .catalog import load, suite
from .contact import ContactProblem
from .errors import ProblemError, ProxbenchError
from .judge import Verdict, judge
from .laws import LawKind, Laws
from .model import Model

__all__ = [
    "Answer",
    "ContactProblem",
    "LawKind",
    "Laws",
    "Model",
    "ProblemError",
    "ProxbenchError",
    "Verdict",
    "judge",
    "load",
    "suite",
]
