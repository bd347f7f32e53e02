"""What a comparison fails on: ``time>10%``, and ``solved<``."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import BenchError

_TIME = re.compile(r"time>(\d+(?:\.\d+)?)%")


@dataclass(frozen=True)
class Condition:
    """One condition.

    Attributes:
        text: as it was written.
        slowdown: the part by which no solver may become slower, 0.1 for 10 %; None where it is about what is solved.
    """

    text: str
    slowdown: float | None = None


def read_conditions(texts: Sequence[str] | str) -> list[Condition]:
    """Return the conditions that texts are, or that one is.

    Raises:
        BenchError: if one is none.
    """
    return [_read(text) for text in ([texts] if isinstance(texts, str) else texts)]


def _read(text: str) -> Condition:
    plain = re.sub(r"\s", "", text)
    if found := _TIME.fullmatch(plain):
        return Condition(plain, float(found[1]) / 100.0)
    if plain == "solved<":
        return Condition(plain)
    raise BenchError(
        f"`fail_on` {text!r} is no condition; write 'time>10%' (a solver is more than 10 % slower) or "
        "'solved<' (an accuracy is no longer reached)."
    )
