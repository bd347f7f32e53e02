"""What all stored records have in common, and what their fields may hold.

Files may come from elsewhere: a checksum shows that they are whole, not that they are honest. Numbers that are not
finite stand as null in files and as None in what is read.
"""

import math
import reprlib
from typing import Annotated

from msgspec import Meta, Struct

LARGEST = 1e300
"""Numbers of files are smaller."""

Number = Annotated[float, Meta(gt=-LARGEST, lt=LARGEST)]
Positive = Annotated[float, Meta(gt=0.0, lt=LARGEST)]
Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Tolerance = Annotated[float, Meta(gt=0.0, lt=1.0)]
Residual = Annotated[Number | None, Meta(extra={"none": math.inf})]
"""A judged residual; the infinite ones are None in what is read."""


class Record(Struct, frozen=True, kw_only=True):
    """Something stored; fields beyond those of its class are ignored when it is read."""

    def __repr__(self) -> str:
        """Return the fields, long values cut short."""
        values = ", ".join(f"{name}={reprlib.repr(getattr(self, name))}" for name in self.__struct_fields__)
        return f"{type(self).__name__}({values})"


class Quartiles(Record, frozen=True, kw_only=True):
    """Times [s]."""

    min: Number
    q1: Number
    median: Number
    q3: Number
