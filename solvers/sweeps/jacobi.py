"""Jacobi sweeps over the assembled Delassus matrix.

One sweep updates every law from the same iterate Λ^ν,

    Λ_i ← prox_{C_i}( Λ_i^ν − r_i ( Σ_j G_ij Λ_j^ν + c_i ) ),

except that the friction bound μ Λ_N uses the normal impulse that the same sweep has just computed (Studer & Glocker
2005, [41–51]).
"""

from collections.abc import Callable
from functools import partial

from numba import njit

from ...problems.arrays import FloatArray
from .any_laws import project_all
from .delassus import DelassusState, DelassusSweep
from .one_contact import disc_scale


class JacobiIterates(DelassusState):
    """Λ and ξ of a Jacobi iteration."""

    def __init__(self, sweep: DelassusSweep, start: FloatArray) -> None:
        super().__init__(sweep.delassus, start)
        self._project: Callable[..., None] = project_all
        if self.layout.has_contacts_only:
            self._project = partial(_project, self.layout.width)
        self._laws = sweep.laws

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps."""
        for _ in range(count):
            self._write_velocity()
            self._project(*self._laws, self._velocity, self.padded)


@njit(cache=True)
def _project(width, step_sizes, friction, fixed_bound, partner, velocity, impulses):  # type: ignore[no-untyped-def]
    """Move Λ along −r ξ and project: all normal impulses, then all friction impulses.

    ``partner`` is the index of the normal impulse that bounds each friction law.
    """
    n_blocks = len(friction)
    for i in range(n_blocks):
        impulses[width * i] = max(impulses[width * i] - step_sizes[2 * i] * velocity[width * i], 0.0)
    if width > 1:
        for i in range(n_blocks):
            k = width * i
            bound = fixed_bound[i] + friction[i] * impulses[partner[i]]
            x = impulses[k + 1] - step_sizes[2 * i + 1] * velocity[k + 1]
            if width == 2:
                impulses[k + 1] = min(max(x, -bound), bound)
            else:
                y = impulses[k + 2] - step_sizes[2 * i + 1] * velocity[k + 2]
                scale = disc_scale(x, y, bound)
                impulses[k + 1] = x * scale
                impulses[k + 2] = y * scale
