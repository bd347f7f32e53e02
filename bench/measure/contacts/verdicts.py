"""Verdicts on the answers of a run; a solver mostly gives the same answer again, and it is judged once."""

import hashlib

from ....problems.arrays import FloatArray
from ....problems.contact.judge import Verdict
from ....problems.contact.model import Model
from ....problems.contact.problem import ContactProblem
from ...store.outcome import verdicts

MAX_VERDICTS = 10_000
"""Verdicts that are remembered."""


class VerdictCache:
    """Verdicts by what was judged."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str, bytes], tuple[Verdict, Verdict]] = {}

    def of(self, problem: ContactProblem, impulses: FloatArray, model: Model) -> tuple[Verdict, Verdict]:
        """Return the verdicts on impulses [N s], shape (n_rows,), under a solver's own model and Coulomb's law."""
        key = problem.digest, str(model), hashlib.sha256(impulses.tobytes()).digest()
        if key not in self._known:
            if len(self._known) >= MAX_VERDICTS:
                self._known.clear()
            self._known[key] = verdicts(problem, impulses, model)
        return self._known[key]
