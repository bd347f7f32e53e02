"""APGD: accelerated projected gradients on the convex model (Mazhar, Heyn, Negrut & Tasora, ACM ToG 34, 2015).

Nesterov's method minimises ½ΛᵀGΛ + cᵀΛ over the product K of friction cones,

    Λ_{k+1} = P_K(y_k − t (G y_k + c)),      y_{k+1} = Λ_{k+1} + β_k (Λ_{k+1} − Λ_k).

The step t is halved while the quadratic upper bound of the function is violated, and grows by a tenth after each
iteration. The method restarts with β = 0 if the gradient and the last step form an acute angle (O'Donoghue & Candès
2015).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import convex_obstacle
from ..iteration.loop import PreparedIteration, iterate
from ..iteration.method import SLIDING, Method
from ..sweeps.cone import ConeProblem

SHRINK, GROW = 0.5, 1.1
"""Factor of t when the bound is violated, and after each iteration."""

MAX_STEP = 100.0
"""Largest t relative to 1/λ_max(G). Without it, impulses that cause no velocity could grow until rounding dominates."""

MAX_HALVINGS = 60
"""Largest number of halvings of t in one iteration."""


@dataclass(frozen=True)
class APGD(Method):
    """Accelerated projected gradient descent for the convex (associated) model; one iteration is one step."""

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    @property
    def model(self) -> Model:
        """The convex model."""
        return Model.CONVEX

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or convex_obstacle(problem)

    def prepare(self, problem: ContactProblem) -> PreparedIteration:
        """Assemble G in scaled variables and estimate its largest eigenvalue."""
        self.check_supports(problem)
        cone = ConeProblem.of(problem)
        step = 1.0 / cone.largest_eigenvalue()
        return iterate(
            problem, lambda start: (cone.size * x for x in _steps(cone, step, start / cone.size)), self.model
        )


def _steps(cone: ConeProblem, step: float, start: FloatArray) -> Iterator[FloatArray]:
    """Yield scaled Λ after each iteration, from ``start``, shape (n_rows,), with the first t = ``step``."""
    x, theta, max_step = cone.projected(start), 1.0, MAX_STEP * step
    y = x
    while True:
        gradient = np.asarray(cone.matrix @ y + cone.free)
        for _ in range(MAX_HALVINGS):
            x_next = cone.projected(y - step * gradient)
            change = x_next - y
            # compare only the quadratic parts, because the linear parts cancel
            if step * float(change @ (cone.matrix @ change)) <= float(change @ change):
                break
            step *= SHRINK
        yield x_next
        if float(gradient @ (x_next - x)) > 0.0:
            theta, y = 1.0, x_next
        else:
            theta_next = 0.5 * (np.sqrt(theta**4 + 4.0 * theta**2) - theta**2)
            y = x_next + theta * (1.0 - theta) / (theta**2 + theta_next) * (x_next - x)
            theta = theta_next
        x, step = x_next, min(GROW * step, max_step)
