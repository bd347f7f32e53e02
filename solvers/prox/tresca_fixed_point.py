"""TrescaFixedPoint: friction with bounds that stay, and bounds renewed from its answer, in turn.

    Λ^{k+1} solves the problem with  ‖Λ_T‖ ≤ b^k  for the friction of each contact,      b^{k+1} = a + μ Λ_N^{k+1}

(Panagiotopoulos 1975; Haslinger 1983; Acary, Brémond & Huber 2018, section 5.5). With given bounds (Tresca's friction)
the problem is the minimum of a convex function over half-lines and discs, which sweeps of SORprox descend. The fixed
point contracts for small μ; for large μ it need not.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import Method, beyond_contacts
from ..sweeps.delassus import DelassusIterates, DelassusSweep, FlatDelassus, law_arguments
from ..sweeps.step_size import diagonal_step_sizes

INNER, MOST_SWEEPS = 0.1, 200
"""Bounds stay until a sweep changes Λ by less than this share of the first one with them, or for so many sweeps."""


@dataclass(frozen=True)
class TrescaFixedPoint(Method):
    """The fixed point of Tresca's friction; one iteration is one sweep."""

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return beyond_contacts(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        self.check_supports(problem)
        delassus, sizes = FlatDelassus.of(problem), diagonal_step_sizes(problem, 1.0)
        return iterate(problem, lambda start: _sweeps(problem, delassus, sizes, start))


def _sweeps(
    problem: ContactProblem, delassus: FlatDelassus, sizes: FloatArray, start: FloatArray
) -> Iterator[FloatArray]:
    layout = problem.layout
    flat, _, fixed, partner = law_arguments(layout, sizes)
    none, impulses = np.zeros(layout.n_blocks), start
    while True:
        normal = np.maximum(layout.pad(impulses)[:, 0], 0.0)
        bounds = fixed + layout.friction_coefficient * normal[layout.partner]
        iterates = DelassusIterates(DelassusSweep(delassus, (flat, none, bounds, partner)), impulses)
        first = np.inf
        for done in range(MOST_SWEEPS):
            before = impulses
            iterates.sweep(1)
            impulses = iterates.impulses()
            yield impulses
            change = float(np.abs(impulses - before).max(initial=0.0))
            first = change if done == 0 else first
            if done > 0 and change <= INNER * first:
                break
