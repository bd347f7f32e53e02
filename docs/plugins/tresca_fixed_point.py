"""TrescaFixedPoint: solve friction with fixed bounds, update the bounds from the solution, and repeat.

    Λ^{k+1} solves the problem with  ‖Λ_T‖ ≤ b^k  for the friction of each contact,      b^{k+1} = a + μ Λ_N^{k+1}

(Panagiotopoulos 1975; Haslinger 1983; Acary, Brémond & Huber 2018, section 5.5). With fixed bounds (Tresca's friction)
a solution minimises a convex function over half-lines and discs, and sweeps of SORprox converge to it. The fixed-point
iteration contracts for small μ, but not always for large μ.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from proxbench.problems import ContactProblem, Model
from proxbench.problems.arrays import FloatArray
from proxbench.solvers import Prepared, iterate, name_with_options
from proxbench.solvers.iteration.method import unsupported_laws
from proxbench.solvers.sweeps.delassus import DelassusIterates, DelassusSweep, FlatDelassus, LawArrays
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes

INNER_CHANGE, MAX_INNER_SWEEPS = 0.1, 200
"""Bounds are fixed until a sweep changes Λ by at most this fraction of the first change, or for this many sweeps."""


@dataclass(frozen=True)
class TrescaFixedPoint:
    """Fixed-point iteration over problems with Tresca's friction; one iteration is one sweep."""

    model = Model.COULOMB
    name = property(name_with_options)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return unsupported_laws(problem)

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Assemble G and the step sizes."""
        delassus, sizes = FlatDelassus.of(problem), diagonal_step_sizes(problem, 1.0)
        return iterate(problem, lambda start: _sweeps(problem, delassus, sizes, start))


def _sweeps(
    problem: ContactProblem, delassus: FlatDelassus, sizes: FloatArray, start: FloatArray
) -> Iterator[FloatArray]:
    layout, impulses = problem.layout, start
    laws = LawArrays.of(layout, sizes)
    while True:
        normal = np.maximum(layout.pad(impulses)[:, 0], 0.0)
        bounds = layout.fixed_bound + layout.friction_coefficient * normal[layout.partner]
        fixed_laws = laws._replace(friction=np.zeros(layout.n_blocks), fixed_bound=bounds)
        iterates = DelassusIterates(DelassusSweep(delassus, fixed_laws), impulses)
        first = np.inf
        for done in range(MAX_INNER_SWEEPS):
            before = impulses
            iterates.sweep(1)
            impulses = iterates.impulses()
            yield impulses
            change = float(np.abs(impulses - before).max(initial=0.0))
            first = change if done == 0 else first
            if done > 0 and change <= INNER_CHANGE * first:
                break


SOLVERS = [TrescaFixedPoint]
