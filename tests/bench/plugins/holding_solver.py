"""SORprox that holds the lock of numba's compiler for some time."""

import time
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from proxbench.problems import ContactProblem, Model
from proxbench.solvers import create

PAUSE_SECONDS = 2e-3


class Holding:
    """SORprox that pretends to compile in every ``prepare``."""

    name, model = "Holding", Model.COULOMB

    def supports(self, problem: ContactProblem) -> str | None:
        return None

    def prepare(self, problem: ContactProblem) -> Any:
        with global_compiler_lock:
            time.sleep(PAUSE_SECONDS)
        return create("SORprox").prepare(problem)
