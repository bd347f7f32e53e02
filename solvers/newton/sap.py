"""SAP: Newton's method for the velocities of bodies, with contacts as stiff springs inside their cones.

The semi-analytic primal method (Castro, Permenter & Han, IEEE Transactions on Robotics 39(2), 2023) minimises over
velocities what the convex model minimises over impulses. In the units of ``cone``, Λ = d x, with W̃ = Sᵀ W d of the
factors and ξ = W̃ᵀ w + d c,

    ℓ(w) = ½‖w‖² + ½ R Σ ‖x_i(w)‖²,      x_i(w) = P_K(x̄_i − ξ_i / R),      ∇ℓ = w − W̃ x,      ∇²ℓ = I + W̃ (D/R) W̃ᵀ

with D the derivatives of the projections: convex, twice differentiable almost everywhere, and without constraints. One
factorisation over bodies serves a step, however many contacts are redundant. With x̄ = 0 the springs stay, and contacts
sink in by R x: that is the method as published, a relaxed model. Here x̄ is renewed by each minimum (multipliers of
Hestenes and Powell), and R falls, so that what is left of it vanishes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import Method, beyond_contacts
from ..sweeps.cone import ConeProblem
from .linear_solver import factorised

FIRST_COMPLIANCE, LEAST_COMPLIANCE, SOFTENING = 0.1, 1e-6, 0.1
"""R at first and at last, where the diagonal of the Delassus matrix is 1, and what each minimum multiplies it with."""

MINIMUM = 1e-3
"""A minimum is found where ‖∇ℓ‖ is below this part of R ‖x − x̄‖, the change that the next multipliers make in ξ."""

ROUNDING = 1e-14
"""No gradient below this part of ‖w‖ is asked for."""

DESCENT, SHORTEST = 1e-4, 2.0**-30
"""What part of its slope a step has to descend, and the shortest part of a step."""


@dataclass(frozen=True)
class SAP(Method):
    """The semi-analytic primal method for the convex (associated) model.

    One iteration is a Newton step or a renewal of x̄.
    """

    @property
    def model(self) -> Model:
        """The convex model."""
        return Model.CONVEX

    def supports(self, problem: ContactProblem) -> str | None:
        """Say why ``problem`` cannot be treated, or None."""
        if problem.factors is None:
            return "the problem holds G only, and this method works on the bodies of W and M⁻¹"
        return beyond_contacts(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Scale W̃; G is assembled for the units of contacts alone."""
        self.check_supports(problem)
        assert problem.factors is not None
        cone = ConeProblem.of(problem)
        directions = sp.csr_array(problem.factors.scaled_directions @ sp.diags_array(cone.size))
        springs = _Springs(cone, directions)
        return iterate(problem, lambda start: (cone.size * x for x in _steps(springs, start / cone.size)), self.model)


class _Springs:
    """ℓ and its derivatives for one R and x̄ at a time.

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
        """Return the Newton step from w, None where it cannot be computed."""
        layout = self._cone.layout
        blocks = _derivatives(self._cone, layout.pad(self._argument(w))) / self.compliance
        n, width = layout.n_blocks, layout.width
        diagonal = sp.csr_array(sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(n * width,) * 2))
        weights = diagonal if layout.is_dense else sp.csr_array(diagonal[layout.slot][:, layout.slot])
        hessian = sp.eye_array(len(w)) + self.directions @ weights @ self.directions.T
        factors = factorised(sp.csr_array(hessian))
        return None if factors is None else np.asarray(-factors.solve(gradient))

    def _argument(self, w: FloatArray) -> FloatArray:
        velocity = self.directions.T @ w + self._cone.free
        return np.asarray(self.centre - velocity / self.compliance)


def _steps(springs: _Springs, start: FloatArray) -> Iterator[FloatArray]:
    springs.compliance, springs.centre = FIRST_COMPLIANCE, start
    w = np.asarray(springs.directions @ start)
    while True:
        x = springs.impulses(w)
        gradient = np.asarray(w - springs.directions @ x)
        length = float(np.linalg.norm(gradient))
        wanted = MINIMUM * springs.compliance * float(np.linalg.norm(x - springs.centre))
        step = None if length <= max(wanted, ROUNDING * float(np.linalg.norm(w))) else springs.step(w, gradient)
        part = 0.0 if step is None else _length(springs, w, gradient, step)
        if step is None or part == 0.0:
            springs.centre, springs.compliance = x, max(SOFTENING * springs.compliance, LEAST_COMPLIANCE)
            w = np.asarray(springs.directions @ x)
        else:
            w = w + part * step
        yield x


def _length(springs: _Springs, w: FloatArray, gradient: FloatArray, step: FloatArray) -> float:
    """Return the part of a step after which ℓ has descended, halved from 1 on; 0 where none is long enough."""
    slope, before, part = float(gradient @ step), springs.value(w), 1.0
    while part >= SHORTEST:
        if springs.value(w + part * step) <= before + DESCENT * part * slope:
            return part
        part *= 0.5
    return 0.0


def _derivatives(cone: ConeProblem, argument: FloatArray) -> FloatArray:
    """Return the derivative of the projection onto each K at ``argument``, shape (n, width), as (n, width, width).

    Inside it is the identity; where the cone is met at N > 0, with t the direction of T and b = a + μN its bound,

        [1, μ tᵀ; μ t, μ² t tᵀ] / (1 + μ²) + (b/‖T‖) [0, 0; 0, I − t tᵀ];

    where N = 0 only the second part stays, with b = a, and all of T where that is in the disc.
    """
    friction, fixed = cone.layout.friction_coefficient, cone.fixed_bound
    n, width = argument.shape
    normal, tangent = argument[:, 0], argument[:, 1:]
    length = np.sqrt((tangent**2).sum(axis=1))
    found = np.zeros((n, width, width))
    inside = length <= fixed + friction * np.maximum(normal, 0.0)
    met = np.where(inside, normal, (normal + friction * (length - fixed)) / (1.0 + friction**2))
    found[:, 0, 0] = np.where(met > 0.0, np.where(inside, 1.0, 1.0 / (1.0 + friction**2)), 0.0)
    if width == 1:
        return found
    along = tangent / np.where(length > 0.0, length, 1.0)[:, None]
    outer = along[:, :, None] * along[:, None, :]
    bound = fixed + friction * np.maximum(met, 0.0)
    across = np.where(inside, 1.0, bound / np.where(length > 0.0, length, 1.0))
    radial = np.where(inside, 1.0, np.where(met > 0.0, friction**2 / (1.0 + friction**2), 0.0))
    found[:, 1:, 1:] = across[:, None, None] * (np.eye(width - 1) - outer) + radial[:, None, None] * outer
    mixed = np.where(inside | (met <= 0.0), 0.0, friction / (1.0 + friction**2))[:, None] * along
    found[:, 0, 1:] = found[:, 1:, 0] = mixed
    return found
