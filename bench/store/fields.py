"""The base class of stored records, the types of their fields, and the text of tolerances.

Files are not trusted, so every number has a range. Numbers that are not finite are null in files, and None in records
that were read.
"""

import math
import reprlib
from typing import Annotated

from msgspec import Meta, Struct

MAX_NUMBER = 1e300
"""Exclusive bound of the absolute value of stored numbers."""

Number = Annotated[float, Meta(gt=-MAX_NUMBER, lt=MAX_NUMBER)]
"""A finite number."""

Positive = Annotated[float, Meta(gt=0.0, lt=MAX_NUMBER)]
"""A positive finite number."""

Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""A nonnegative integer."""

Tolerance = Annotated[float, Meta(gt=0.0, lt=1.0)]
"""A tolerance, between 0 and 1."""

TOLERANCE_ROUNDING = 1e-9
"""Relative difference up to which two tolerances are equal."""

Residual = Annotated[Number | None, Meta(extra={"none": math.inf})]
"""A judged residual; None in a record that was read means infinity."""


def accuracy_tag(accuracy: float) -> str:
    """Return a tolerance or an accuracy with all its digits, as in the names of columns: ``"1e-04"``, ``"2.5e-04"``."""
    texts = (f"{accuracy:.{digits}e}" for digits in range(16))
    return next(
        (text for text in texts if math.isclose(float(text), accuracy, rel_tol=TOLERANCE_ROUNDING)), f"{accuracy:e}"
    )


def exponent(tolerance: float) -> str:
    """Return a tolerance with all its digits and a short exponent, as in charts: ``"1e-4"``, ``"2.5e-4"``."""
    mantissa, _, power = accuracy_tag(tolerance).partition("e")
    return f"{mantissa}e{int(power)}"


class Record(Struct, frozen=True, kw_only=True):
    """A stored record. Unknown fields of a file are ignored."""

    def __repr__(self) -> str:
        """Return the fields, with long values truncated."""
        values = ", ".join(f"{name}={reprlib.repr(getattr(self, name))}" for name in self.__struct_fields__)
        return f"{type(self).__name__}({values})"


class Quartiles(Record, frozen=True, kw_only=True):
    """Minimum, quartiles and median of times [s]."""

    min: Number
    q1: Number
    median: Number
    q3: Number
