"""Jprox and JORprox: the projected Jacobi iterations of Studer & Glocker 2005, [41–51].

One sweep updates every law from the same iterate ν,

    Λ_i ← prox_{C_i}( Λ_i^ν − r_i ( Σ_j G_ij Λ_j^ν + c_i ) ),

except that the friction bound μ Λ_N takes the normal impulse that the same sweep has just computed. Jprox is the case
r_i = 1/α_i, for which the argument of the prox reads −1/α_i ( Σ_{j≠i} G_ij Λ_j + c_i + B_i Λ_i ), G_ii = α_i I + B_i.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Residual
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.names import described
from ..iteration.loop import PreparedIteration
from ..sweeps.delassus import DelassusSweep, block_product
from ..sweeps.projection import disc_scale
from ..sweeps.step_size import StepSize, check_options, diagonal_step_sizes, row_sum_step_sizes, row_sums_of_blocks


@dataclass(frozen=True)
class JORprox:
    """Projected Jacobi over-relaxation.

    Attributes:
        step_size: r by the "diagonal" [52] or by the "row_sum" [53] of G.
        relaxation: ω; many contacts need values well below 1.

    Raises:
        SolverError: for an option out of range.
    """

    step_size: StepSize = "diagonal"
    relaxation: float = 1.0

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_options(self.step_size, self.relaxation)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        if self.step_size == "diagonal":
            sizes = diagonal_step_sizes(problem, self.relaxation)
        else:
            sums = row_sums_of_blocks(problem.delassus_blocks(), problem)
            sizes = row_sum_step_sizes(problem, sums, self.relaxation)
        return PreparedIteration(problem, Residual(problem), lambda start: _JacobiIterates(problem, sizes, start))


@dataclass(frozen=True)
class Jprox:
    """Projected Jacobi, [46]: JORprox with r_i = 1/α_i, the paper's first and simplest method."""

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Class name."""
        return described(self)

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        return None

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G and the step sizes."""
        return JORprox().prepare(problem)


class _JacobiIterates:
    """Λ and ξ of a Jacobi iteration, padded and flat."""

    def __init__(self, problem: ContactProblem, sizes: FloatArray, start: FloatArray) -> None:
        self._sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        self._impulses = self._sweep.layout.pad(start).reshape(-1)
        self._velocity = np.empty_like(self._impulses)

    def sweep(self, count: int) -> None:
        width = self._sweep.layout.width
        for _ in range(count):
            self._update_velocity()
            _project(width, *self._sweep.laws, self._velocity, self._impulses)

    def impulses(self) -> FloatArray:
        return self._sweep.layout.unpad(self._impulses)

    def relative_velocity(self) -> FloatArray:
        self._update_velocity()
        return self._sweep.layout.unpad(self._velocity)

    def _update_velocity(self) -> None:
        block_product(self._sweep.layout.width, *self._sweep.matrix, self._impulses, self._sweep.free, self._velocity)


@njit(cache=True)
def _project(width, sizes, friction, fixed, partner, velocity, impulses):  # type: ignore[no-untyped-def]
    """Move Λ along −r ξ and project: all normal impulses, then all friction impulses."""
    n_blocks = len(friction)
    for i in range(n_blocks):
        impulses[width * i] = max(impulses[width * i] - sizes[2 * i] * velocity[width * i], 0.0)
    if width > 1:
        for i in range(n_blocks):
            k = width * i
            bound = fixed[i] + friction[i] * impulses[partner[i]]
            x = impulses[k + 1] - sizes[2 * i + 1] * velocity[k + 1]
            if width == 2:
                impulses[k + 1] = min(max(x, -bound), bound)
            else:
                y = impulses[k + 2] - sizes[2 * i + 1] * velocity[k + 2]
                scale = disc_scale(x, y, bound)
                impulses[k + 1] = x * scale
                impulses[k + 2] = y * scale
