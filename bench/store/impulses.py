"""The impulses that a run stores, from which its residuals can be recomputed."""

import zlib
from collections.abc import Iterable
from typing import Self

import numpy as np

from ...problems.arrays import FloatArray
from ...problems.contact.judge import Verdict
from .conversion import decompress
from .fields import Record, Residual

_NUMBER = np.dtype("<f8")

_FAST = 1
"""Level of compression; higher levels save no space, because only zeros are compressible."""


def number_of(residual: float | None) -> float:
    """Return a stored residual as a number; None and NaN mean infinity."""
    return np.inf if residual is None or not residual < np.inf else residual


class Impulses(Record, frozen=True, kw_only=True):
    """Impulses that a solver returned, with their residuals.

    Attributes:
        residual: judged residual under Coulomb's law.
        model_residual: judged residual under the solver's own model.
        packed: Λ [N s] in double precision, little-endian, compressed by zlib.
    """

    residual: Residual
    model_residual: Residual
    packed: bytes

    @classmethod
    def of(cls, impulses: FloatArray, own: Verdict, coulomb: Verdict) -> Self:
        """Pack Λ [N s], shape (n_rows,), with the verdicts under the solver's own model and Coulomb's law."""
        packed = zlib.compress(np.ascontiguousarray(impulses, dtype=_NUMBER).tobytes(), _FAST)
        return cls(residual=coulomb.residual, model_residual=own.residual, packed=packed)

    def unpacked(self, n_rows: int) -> FloatArray:
        """Return Λ [N s], shape (n_rows,).

        Raises:
            ValueError: if the data are damaged, or not ``n_rows`` numbers.
        """
        content = decompress(self.packed, _NUMBER.itemsize * n_rows)
        if len(content) != _NUMBER.itemsize * n_rows:
            raise ValueError(f"expected {n_rows} numbers, one per row")
        return np.frombuffer(content, dtype=_NUMBER).astype(np.float64)


def worst(answers: Iterable[Impulses]) -> list[Impulses]:
    """Return the worst impulses under Coulomb's law and under the solver's model; one item if they are the same.

    Among equal residuals, the first counts.
    """
    candidates = list(answers)
    if not candidates:
        return []
    under_coulomb = max(candidates, key=lambda answer: number_of(answer.residual))
    under_model = max([under_coulomb, *candidates], key=lambda answer: number_of(answer.model_residual))
    return [under_coulomb] if under_model is under_coulomb else [under_coulomb, under_model]
