"""Options of scenes: types, ranges and defaults."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...errors import ProblemError, suggestion
from ...names import check_options

OptionValue = int | float | bool | str | tuple[float, ...] | None
"""Types of option values; None switches an effect off."""


@dataclass(frozen=True)
class Option:
    """One option of a scene; its type is that of its default, or a number if the default is None.

    Attributes:
        default: the default value.
        meaning: its description for users, with the unit.
        lowest: smallest allowed number.
        highest: largest allowed number.
        choices: allowed words, if the value is a word.
        can_be_off: whether None, which switches the effect off, is allowed.
    """

    default: OptionValue
    meaning: str
    lowest: float = 0.0
    highest: float = math.inf
    choices: tuple[str, ...] = ()
    can_be_off: bool = False

    def checked(self, name: str, value: object) -> OptionValue:
        """Return ``value`` converted to the type of this option.

        Raises:
            ProblemError: if the value has the wrong type or is out of range; messages call the option ``name``.
        """
        if value is None and self.can_be_off:
            return None
        if self.choices:
            if value in self.choices and isinstance(value, str):
                return value
            raise ProblemError(f"{name} cannot be {value!r}{suggestion(str(value), self.choices)}")
        if isinstance(self.default, tuple):
            if isinstance(value, list | tuple):
                return tuple(float(self._checked_number(name, part)) for part in value)
            raise ProblemError(f"{name} must be a tuple of numbers such as (1.0, 2.0), got {value!r}.")
        if isinstance(self.default, bool):
            if isinstance(value, bool):
                return value
            raise ProblemError(f"{name} must be true or false, got {value!r}.")
        return self._checked_number(name, value)

    def _checked_number(self, name: str, value: object) -> int | float:
        is_integer = isinstance(self.default, int)
        types = (int, np.integer) if is_integer else (int, float, np.integer, np.floating)
        if isinstance(value, types) and not isinstance(value, bool):
            number = int(value) if is_integer else float(value)
            # no option may be infinite, and NaN fails every comparison
            if self.lowest <= number <= self.highest and number < math.inf:
                return number
        kind = "a whole number" if is_integer else "a number"
        raise ProblemError(f"{name} must be {kind} {self._range()}, got {value!r}.")

    def _range(self) -> str:
        if self.highest == math.inf:
            return "that is finite" if self.lowest == -math.inf else f"of at least {self.lowest:g}"
        return f"between {self.lowest:g} and {self.highest:,.10g}"


def complete(scene: str, options: Mapping[str, Option], values: Mapping[str, object]) -> dict[str, OptionValue]:
    """Return the value of each option of the scene called ``scene``: the checked value in ``values``, or the default.

    Raises:
        ProblemError: if an option is unknown (the message suggests the nearest one), or a value is out of range.
    """
    check_options(f"the scene {scene!r}", values, options, ProblemError)
    return {
        name: option.checked(name, values[name]) if name in values else option.default
        for name, option in options.items()
    }
