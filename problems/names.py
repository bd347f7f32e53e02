"""Names with options, such as ``SORprox(relaxation=1.5)``, of solvers, steppers and scenes.

Their grammar is

    name     plain | plain(part, …, option=value, …)
    part     a name, possibly with options: Fallback(SORprox, NSGS(relaxation=0.5))
    value    a Python literal
"""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import ProxbenchError, suggestion


@dataclass(frozen=True)
class Name:
    """A parsed name.

    Attributes:
        plain: the name of the class, function or scene.
        options: values by name of the option.
        parts: the parts in order; empty for most names.
    """

    plain: str
    options: Mapping[str, Any] = field(default_factory=dict)
    parts: tuple["Name", ...] = ()

    def __str__(self) -> str:
        arguments = [*map(str, self.parts), *(f"{option}={value!r}" for option, value in self.options.items())]
        return f"{self.plain}({', '.join(arguments)})" if arguments else self.plain


def read_name(text: str, kind: str, example: str, error: type[ProxbenchError]) -> Name:
    """Parse a name with options.

    Args:
        text: the text to parse.
        kind: the kind of thing that the text names, such as "solver", for the error message.
        example: a name with options, for the error message.
        error: the class of the error.

    Raises:
        ProxbenchError: of class ``error``, if the text is not a name.
    """
    try:
        return _parse(ast.parse(str.strip(text), mode="eval").body)
    except (TypeError, SyntaxError, ValueError, RecursionError, MemoryError):
        raise error(
            f"cannot read {text!r:.200} as a {kind}; write a name, or a name with options: {example}."
        ) from None


def check_options(owner: str, options: Iterable[str], known: Iterable[str], error: type[ProxbenchError]) -> None:
    """Raise ``error`` for the first option that ``owner`` does not have, and suggest the nearest known option."""
    names = list(known)
    for option in options:
        if option not in names:
            raise error(f"{owner} has no option {option!r}{suggestion(option, names)}")


def name_with_options(thing: Any) -> str:
    """Return the name of a dataclass instance: its class, and the options that differ from their defaults."""
    fields = thing.__dataclass_fields__
    values = {name: value for name, field in fields.items() if (value := getattr(thing, name)) != field.default}
    return str(Name(type(thing).__name__, values)) if values else type(thing).__name__


def _parse(node: ast.expr) -> Name:
    """Return the name of an expression; raise ``ValueError`` if the expression is not a name."""
    if isinstance(node, ast.Name):
        return Name(node.id)
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
        raise ValueError("it is not a name")
    if any(keyword.arg is None for keyword in node.keywords):
        raise ValueError("an option has no name")
    options = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in node.keywords}
    return Name(node.func.id, options, tuple(map(_parse, node.args)))
