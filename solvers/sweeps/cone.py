"""The contact problem over whole friction cones, in units of its contacts.

Λ = d x with d_i = 1/√α_i for all rows of contact i, where α_i is its largest diagonal entry of G. The largest diagonal
entry of each contact in d G d is then one for any masses, and the cones keep their form,

    K = {x_N ≥ 0, ‖x_T‖ ≤ a/d + μ x_N}.

Splitting and gradient methods, which weight all contacts equally, work on x.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.blocks import BlockLayout
from ...problems.contact.problem import ContactProblem
from ...problems.contact.projections import onto_cone

POWER_STEPS = 20
"""Number of steps of the power method for the largest eigenvalue."""


@dataclass(frozen=True, eq=False)
class ConeProblem:
    """A contact problem whose friction laws are bounded by their own contacts, in x.

    Attributes:
        layout: the padded blocks.
        matrix: d G d, shape (n_rows, n_rows).
        free: d c, shape (n_rows,).
        fixed_bound: a/d of each block, shape (n_blocks,).
        size: d of each row, shape (n_rows,).
    """

    layout: BlockLayout
    matrix: sp.csr_array
    free: FloatArray
    fixed_bound: FloatArray
    size: FloatArray

    @staticmethod
    def of(problem: ContactProblem) -> "ConeProblem":
        """Return ``problem`` in the variables x."""
        layout = problem.layout
        largest = layout.pad(problem.delassus_diagonal).max(axis=1, initial=0.0)
        block_size = 1.0 / np.sqrt(np.where(largest > 0.0, largest, 1.0))
        size = block_size[layout.contact_of_row]
        scaling = sp.diags_array(size)
        matrix = sp.csr_array(scaling @ problem.delassus() @ scaling)
        return ConeProblem(layout, matrix, size * problem.free_velocity, layout.fixed_bound / block_size, size)

    def projected(self, x: FloatArray) -> FloatArray:
        """Return the projection of x, shape (n_rows,), onto the product of all K."""
        layout, padded = self.layout, self.layout.pad(x)
        bounds = (layout.friction_coefficient,), (self.fixed_bound,)
        normal, (tangent,) = onto_cone(padded[:, 0], (padded[:, 1:],), *bounds)
        return layout.unpad(np.column_stack([normal, tangent]))

    def lift(self, velocity: FloatArray) -> FloatArray:
        """Return De Saxcé's term μ‖ξ_T‖ e_N of a velocity in the units of x, both of shape (n_rows,)."""
        lifted = np.zeros((self.layout.n_blocks, self.layout.width))
        tangent = self.layout.pad(velocity)[:, 1:]
        lifted[:, 0] = self.layout.friction_coefficient * np.sqrt((tangent**2).sum(axis=1))
        return self.layout.unpad(lifted)

    def largest_eigenvalue(self) -> float:
        """Return a lower estimate of the largest eigenvalue of d G d by the power method; 1 if it is zero."""
        vector = np.random.default_rng(0).uniform(0.5, 1.0, len(self.free))
        for _ in range(POWER_STEPS):
            length = float(np.linalg.norm(vector))
            if length == 0.0:
                return 1.0
            vector = self.matrix @ (vector / length)
        return float(np.linalg.norm(vector)) or 1.0
