"""A solver that solves only in other processes than the one that created it."""

import os
from typing import Any

from proxbench.problems import ContactProblem, Model
from proxbench.solvers import create


class Elsewhere:
    """SORprox that solves only in other processes."""

    name, model, has_iterates = "Elsewhere", Model.COULOMB, False

    def __init__(self) -> None:
        self._made_in = os.getpid()

    def supports(self, problem: ContactProblem) -> str | None:
        return None if os.getpid() != self._made_in else "this process made it"

    def prepare(self, problem: ContactProblem) -> Any:
        return create("SORprox").prepare(problem)
