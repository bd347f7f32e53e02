"""Jacobi sweeps over the assembled Delassus matrix.

One sweep updates every law from the same iterate ν,

    Λ_i ← prox_{C_i}( Λ_i^ν − r_i ( Σ_j G_ij Λ_j^ν + c_i ) ),

except that the friction bound μ Λ_N takes the normal impulse that the same sweep has just computed (Studer & Glocker
2005, [41–51]).
"""

import numpy as np
from numba import njit

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from .delassus import DelassusSweep, block_product
from .one_contact import disc_scale


class JacobiIterates:
    """Λ and ξ of a Jacobi iteration, padded and flat."""

    def __init__(self, problem: ContactProblem, sizes: FloatArray, start: FloatArray) -> None:
        self._sweep = DelassusSweep.over(problem, problem.delassus_blocks(), sizes)
        self._impulses = self._sweep.layout.pad(start).reshape(-1)
        self._velocity = np.empty_like(self._impulses)

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        width = self._sweep.layout.width
        for _ in range(count):
            self._update_velocity()
            _project(width, *self._sweep.laws, self._velocity, self._impulses)

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._sweep.layout.unpad(self._impulses)

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
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
