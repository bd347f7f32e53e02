"""The registry, which creates steppers by name with options: ``make_stepper("Extrapolated(tolerance=1e-8)")``."""

from dataclasses import fields
from typing import Any

from ...errors import ProblemError, suggestion
from ...names import check_options, read_name
from .event_driven.event_driven import EventDriven
from .extrapolated import Extrapolated
from .moreau import Moreau
from .step_doubling import StepDoubling
from .stepper import Stepper

STEPPERS: dict[str, type[Stepper]] = {kind.__name__: kind for kind in (Moreau, Extrapolated, StepDoubling, EventDriven)}
"""Steppers by name."""

EXAMPLE = "Extrapolated(tolerance=1e-8)"
"""A stepper with an option, for error messages."""

_TYPES = {str: (str, "a name"), int: (int, "a whole number")}
"""Types of an option and their description, by the type of its default value; all other options are numbers."""


def make_stepper(text: str) -> Stepper:
    """Return a stepper: ``make_stepper("Moreau(step=5e-4)")``.

    Raises:
        ProblemError: if the stepper, an option or the search of switching points is unknown (the message suggests the
            nearest name), or a value has the wrong type.
    """
    parsed = read_name(text, "stepper", EXAMPLE, ProblemError)
    name = parsed.plain
    if name not in STEPPERS:
        raise ProblemError(f"there is no stepper {name!r}{suggestion(name, STEPPERS)}")
    kind: Any = STEPPERS[name]
    if parsed.parts:
        raise ProblemError(f"cannot read {text!r:.200} as a stepper; name its options: {EXAMPLE}.")
    defaults = {field.name: field.default for field in fields(kind)}
    check_options(name, parsed.options, defaults, ProblemError)
    for option, value in parsed.options.items():
        if value is None and defaults[option] is None:  # the scene determines the number
            continue
        types, type_text = _TYPES.get(type(defaults[option]), ((int, float), "a number"))
        if not isinstance(value, types) or isinstance(value, bool):
            raise ProblemError(f"{option} of {name} must be {type_text}, got {value!r}.")
    stepper: Stepper = kind(**parsed.options)
    return stepper
