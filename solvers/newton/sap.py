"""SAP: Newton's method for body velocities, with contacts as stiff springs inside their cones.

The semi-analytic primal method (Castro, Permenter & Han, IEEE Transactions on Robotics 39(2), 2023) minimises over
velocities the energy that the convex model minimises over impulses. In the units of ``cone``, with Λ = d x, M⁻¹ = S Sᵀ,
W̃ = Sᵀ W d, ξ = W̃ᵀ w + d c, a compliance R and multipliers x̄, it minimises

    ℓ(w) = ½‖w‖² + ½ R Σ ‖x_i(w)‖²,      x_i(w) = P_K(x̄_i − ξ_i / R),      ∇ℓ = w − W̃ x,      ∇²ℓ = I + W̃ (D/R) W̃ᵀ

with D the derivatives of the projections. ℓ is convex, twice differentiable almost everywhere, and unconstrained. A
step needs one factorisation over bodies, for any number of redundant contacts. With x̄ = 0, contacts penetrate with the
velocity R x. This is the published method, which solves a relaxed model. Here x̄ is updated after each minimisation
(the method of multipliers of Hestenes and Powell), and R decreases, so that the relaxation vanishes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import SLIDING, Method
from ..sweeps.cone import ConeProblem
from .linear_solver import factorise

FIRST_COMPLIANCE, MIN_COMPLIANCE, COMPLIANCE_FACTOR = 0.1, 1e-6, 0.1
"""First and smallest R, for a Delassus matrix of unit diagonal, and the factor of R after each minimisation."""

GRADIENT_TOLERANCE = 1e-3
"""A minimisation ends when ‖∇ℓ‖ is below this fraction of R ‖x − x̄‖, the change of ξ by the next x̄."""

ROUNDING = 1e-14
"""Gradients below this fraction of ‖w‖ are rounding errors."""

SUFFICIENT_DECREASE, MIN_STEP = 1e-4, 2.0**-30
"""Share of the linear decrease that a step has to reach, and the smallest fraction of a step."""


@dataclass(frozen=True)
class SAP(Method):
    """The semi-analytic primal method for the convex (associated) model.

    One iteration is a Newton step or an update of x̄.
    """

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    @property
    def model(self) -> Model:
        """The convex model."""
        return Model.CONVEX

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        if problem.factors is None:
            return "the problem holds G only, and this method needs the factors W and M⁻¹"
        return super().supports(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Scale W̃, and assemble G to find the units of the contacts."""
        self.check_supports(problem)
        assert problem.factors is not None
        cone = ConeProblem.of(problem)
        directions = sp.csr_array(problem.factors.scaled_directions @ sp.diags_array(cone.size))
        springs = _Springs(cone, directions)
        return iterate(problem, lambda start: (cone.size * x for x in _steps(springs, start / cone.size)), self.model)


class _Springs:
    """ℓ and its derivatives for the current R and x̄.

    Attributes:
        compliance: R.
        centre: x̄, shape (n_rows,).
    """

    def __init__(self, cone: ConeProblem, directions: sp.csr_array) -> None:
        self._cone, self.directions = cone, directions
        self.compliance, self.centre = FIRST_COMPLIANCE, np.zeros(len(cone.free))

    def impulses(self, w: FloatArray) -> FloatArray:
        """Return x(w)."""
        return self._cone.projected(self._argument(w))

    def value(self, w: FloatArray) -> float:
        """Return ℓ(w)."""
        x = self.impulses(w)
        return 0.5 * float(w @ w) + 0.5 * self.compliance * float(x @ x)

    def step(self, w: FloatArray, gradient: FloatArray) -> FloatArray | None:
        """Return the Newton step from w, or None if the Hessian is singular."""
        layout = self._cone.layout
        blocks = _derivatives(self._cone, layout.pad(self._argument(w))) / self.compliance
        n, width = layout.n_blocks, layout.width
        diagonal = sp.csr_array(sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * width,) * 2))
        weights = diagonal if layout.is_dense else sp.csr_array(diagonal[layout.slot][:, layout.slot])
        hessian = sp.eye_array(len(w)) + self.directions @ weights @ self.directions.T
        factors = factorise(sp.csr_array(hessian))
        return None if factors is None else np.asarray(-factors.solve(gradient))

    def _argument(self, w: FloatArray) -> FloatArray:
        velocity = self.directions.T @ w + self._cone.free
        return np.asarray(self.centre - velocity / self.compliance)


def _steps(springs: _Springs, start: FloatArray) -> Iterator[FloatArray]:
    """Yield x after each Newton step or update of x̄, from x = ``start``, shape (n_rows,)."""
    springs.compliance, springs.centre = FIRST_COMPLIANCE, start
    w = np.asarray(springs.directions @ start)
    while True:
        x = springs.impulses(w)
        gradient = np.asarray(w - springs.directions @ x)
        length = float(np.linalg.norm(gradient))
        gradient_limit = GRADIENT_TOLERANCE * springs.compliance * float(np.linalg.norm(x - springs.centre))
        step = None if length <= max(gradient_limit, ROUNDING * float(np.linalg.norm(w))) else springs.step(w, gradient)
        fraction = 0.0 if step is None else _step_fraction(springs, w, gradient, step)
        if step is None or fraction == 0.0:
            springs.centre, springs.compliance = x, max(COMPLIANCE_FACTOR * springs.compliance, MIN_COMPLIANCE)
            w = np.asarray(springs.directions @ x)
        else:
            w = w + fraction * step
        yield x


def _step_fraction(springs: _Springs, w: FloatArray, gradient: FloatArray, step: FloatArray) -> float:
    """Return the first fraction 1, ½, ¼, … of a step that decreases ℓ sufficiently, or 0 if there is none."""
    slope, old_value, fraction = float(gradient @ step), springs.value(w), 1.0
    while fraction >= MIN_STEP:
        if springs.value(w + fraction * step) <= old_value + SUFFICIENT_DECREASE * fraction * slope:
            return fraction
        fraction *= 0.5
    return 0.0


def _derivatives(cone: ConeProblem, argument: FloatArray) -> FloatArray:
    """Return the derivative of the projection onto each K at ``argument``, shape (n, width), as (n, width, width).

    Inside the cone, the derivative is the identity. Where the projection lies on the surface of the cone at N > 0, it
    is, with the direction t of T and the bound b = a + μN,

        [1, μ tᵀ; μ t, μ² t tᵀ] / (1 + μ²) + (b/‖T‖) [0, 0; 0, I − t tᵀ].

    At N = 0, only the second part remains, with b = a, or, inside the disc, the identity over T.
    """
    friction, fixed_bound = cone.layout.friction_coefficient, cone.fixed_bound
    n, width = argument.shape
    normal, tangent = argument[:, 0], argument[:, 1:]
    length = np.sqrt((tangent**2).sum(axis=1))
    derivatives = np.zeros((n, width, width))
    is_inside = length <= fixed_bound + friction * np.maximum(normal, 0.0)
    normal_impulse = np.where(is_inside, normal, (normal + friction * (length - fixed_bound)) / (1.0 + friction**2))
    derivatives[:, 0, 0] = np.where(normal_impulse > 0.0, np.where(is_inside, 1.0, 1.0 / (1.0 + friction**2)), 0.0)
    if width == 1:
        return derivatives
    along = tangent / np.where(length > 0.0, length, 1.0)[:, None]
    outer = along[:, :, None] * along[:, None, :]
    bound = fixed_bound + friction * np.maximum(normal_impulse, 0.0)
    across = np.where(is_inside, 1.0, bound / np.where(length > 0.0, length, 1.0))
    radial = np.where(is_inside, 1.0, np.where(normal_impulse > 0.0, friction**2 / (1.0 + friction**2), 0.0))
    derivatives[:, 1:, 1:] = across[:, None, None] * (np.eye(width - 1) - outer) + radial[:, None, None] * outer
    mixed = np.where(is_inside | (normal_impulse <= 0.0), 0.0, friction / (1.0 + friction**2))[:, None] * along
    derivatives[:, 0, 1:] = derivatives[:, 1:, 0] = mixed
    return derivatives
