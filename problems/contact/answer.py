"""Known solutions of problems: impulses where they are unique, otherwise velocities and sums."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FloatArray, ReadOnlyRecord, frozen
from ..errors import ProblemError


@dataclass(frozen=True, eq=False)
class Answer(ReadOnlyRecord):
    """The known part of a solution; fields without a value are not unique or not known.

    Attributes:
        impulses: all solutions Λ [N s], each of shape (n_rows,), if there are finitely many; any of them is correct.
        velocity: ξ [m/s], shape (n_rows,), if the relative velocity is unique.
        functionals: A, shape (k, n_rows), if only A Λ = values is unique (a sum of impulses, their moment).
        values: the right-hand side of ``functionals``, shape (k,).
        solvable: False if the problem has no solution and must be reported as infeasible.
        witness: one solution Λ [N s], shape (n_rows,), which proves that the problem is solvable.
        sensitivity: largest ratio of ``error``, the relative error of velocities and impulses, to the judge's residual.

    Raises:
        ProblemError: if ``impulses`` is not a list of vectors, or a number is not finite or not real.
    """

    impulses: tuple[FloatArray, ...] = ()
    velocity: FloatArray | None = None
    functionals: FloatArray | None = None
    values: FloatArray | None = None
    solvable: bool = True
    witness: FloatArray | None = None
    sensitivity: float = 100.0

    def __post_init__(self) -> None:
        impulses: object = self.impulses
        is_list = isinstance(impulses, Sequence | np.ndarray)
        vectors = enumerate(self.impulses if is_list else ())
        known = tuple(_known(vector, f"impulses[{index}]") for index, vector in vectors)
        if not is_list or any(vector.ndim != 1 for vector in known):
            raise ProblemError(
                "answer.impulses must be a list of vectors, one for each solution; for one solution, pass [impulses]."
            )
        object.__setattr__(self, "impulses", known)
        for name in ("velocity", "functionals", "values", "witness"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _known(getattr(self, name), name))
        sensitivity: object = self.sensitivity
        if not isinstance(sensitivity, int | float | np.integer | np.floating) or not 0.0 < sensitivity < np.inf:
            raise ProblemError(f"answer.sensitivity must be a positive, finite number, got {sensitivity!r:.60}.")

    def check(self, n_rows: int) -> None:
        """Raise ``ProblemError`` unless every array fits a problem of ``n_rows`` rows."""
        vectors = {f"impulses[{index}]": impulses for index, impulses in enumerate(self.impulses)}
        for name, known in {**vectors, "velocity": self.velocity, "witness": self.witness}.items():
            if known is not None and np.shape(known) != (n_rows,):
                raise ProblemError(f"answer.{name} must have shape ({n_rows},), got {np.shape(known)}.")
        if (self.functionals is None) != (self.values is None):
            raise ProblemError("answer.functionals and answer.values belong together; one of them is missing.")
        if self.functionals is None or self.values is None:
            return
        if np.shape(self.functionals) != (len(self.values), n_rows):
            shape = np.shape(self.functionals)
            raise ProblemError(f"answer.functionals must have shape (len(values), {n_rows}), got {shape}.")

    def impulse_error(self, impulses: ArrayLike) -> float | None:
        """Return the largest deviation from the known impulses, or from the known sums [N s]; None if neither is known.

        If there are several solutions, this is the distance to the nearest one.
        """
        vector = np.asarray(impulses, dtype=np.float64)
        if self.impulses:
            return float(min(np.abs(vector - known).max(initial=0.0) for known in self.impulses))
        if self.functionals is not None and self.values is not None:
            return float(np.abs(self.functionals @ vector - self.values).max(initial=0.0))
        return None

    def error(self, impulses: ArrayLike, velocity: ArrayLike, speed: float) -> float | None:
        """Return the largest relative error of the known parts, dimensionless; None if none is known.

        Args:
            impulses: Λ [N s], shape (n_rows,), compared with the largest known impulse or sum.
            velocity: ξ = GΛ + c [m/s], shape (n_rows,), compared with ``speed``.
            speed: the largest free velocity [m/s].
        """
        errors = []
        if self.velocity is not None:
            errors.append(ratio(float(np.abs(np.asarray(velocity) - self.velocity).max(initial=0.0)), speed))
        known = self.impulses or (() if self.values is None else (self.values,))
        scale = max((float(np.abs(array).max(initial=0.0)) for array in known), default=0.0)
        deviation = self.impulse_error(impulses)
        if deviation is not None and scale > 0.0:
            errors.append(deviation / scale)
        return max(errors, default=None)


def _known(values: ArrayLike, name: str) -> FloatArray:
    """Return a read-only copy of a part of an answer; raise ``ProblemError`` if a number is not finite."""
    array: FloatArray = frozen(values, np.float64, f"answer.{name}")
    if not np.isfinite(array).all():
        raise ProblemError(f"answer.{name} has a number that is not finite; omit what is not known.")
    return array


def ratio(value: float, scale: float) -> float:
    """Return value / scale with 0/0 = 0 and x/0 = inf; NaN becomes inf."""
    if value == 0.0:
        return 0.0
    quotient = float(value) / scale if scale > 0.0 else np.inf
    return quotient if quotient == quotient else np.inf
