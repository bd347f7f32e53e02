"""Help pages in plain text: commands and options under topics, and examples."""

from collections.abc import Iterable
from typing import Any

from typer.core import TyperCommand, TyperGroup

ARGUMENTS, OUTPUT, OPTIONS = "Arguments", "Output", "Options"
"""Topics that stand first and last; arguments and options without a topic of their own go to the outer two."""

COLUMNS = 26
"""Longest names of options in one line with their help."""

_VALUES = {"str": "NAME", "float": "NUMBER", "int": "NUMBER", "path": "PATH", "Path": "PATH"}
"""What stands for the value of an option, by its type, where the option does not say it itself."""


class _WithExamples:
    """Writes the epilog as examples, a line each, below all topics."""

    epilog: str | None

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        if self.epilog:
            with formatter.section("Examples"):
                for line in self.epilog.splitlines():
                    formatter.write(f"  {line}\n")


class HelpCommand(_WithExamples, TyperCommand):
    """A command whose options stand under the topics named by their ``rich_help_panel``, its examples below them."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options, those of the output and those without a topic last."""
        _write_topics(formatter, [(_topic(parameter), _row(parameter, ctx)) for parameter in self.get_params(ctx)])


class HelpGroup(_WithExamples, TyperGroup):
    """The whole program; its commands stand under the topics named by their ``rich_help_panel``."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the commands, and the program's own options below them."""
        rows = [
            (getattr(command, "rich_help_panel", None) or OPTIONS, (name, command.short_help or ""))
            for name, command in self.commands.items()
            if not command.hidden
        ]
        rows += [(OPTIONS, _row(parameter, ctx)) for parameter in self.get_params(ctx)]
        _write_topics(formatter, rows)


def _topic(parameter: Any) -> str:
    default = ARGUMENTS if parameter.param_type_name == "argument" else OPTIONS
    return getattr(parameter, "rich_help_panel", None) or default


def _row(parameter: Any, ctx: Any) -> tuple[str, str]:
    """Return the name of an argument or option, with its value, and its help; no name for what is hidden."""
    record = parameter.get_help_record(ctx)
    if record is None:
        return "", ""
    if parameter.param_type_name == "argument":
        return parameter.metavar or parameter.name, record[1].replace("  [required]", "")
    if parameter.secondary_opts:
        return f"--[no-]{parameter.opts[0].removeprefix('--')}", record[1].partition("  [default")[0]
    names = ", ".join(sorted(parameter.opts, key=len))
    return (names if parameter.is_flag else f"{names} {parameter.metavar or _value(parameter, ctx)}"), record[1]


def _value(parameter: Any, ctx: Any) -> str:
    kind = str(parameter.display_type(ctx)).strip("<>").removeprefix("list[").removesuffix("]")
    return _VALUES.get(kind, kind.upper())


def _write_topics(formatter: Any, rows: Iterable[tuple[str, tuple[str, str]]]) -> None:
    topics: dict[str, list[tuple[str, str]]] = {ARGUMENTS: []}
    for topic, row in rows:
        if row[0]:
            topics.setdefault(topic, []).append(row)
    for last in (OUTPUT, OPTIONS):
        topics[last] = topics.pop(last, [])
    widest = max((len(name) for members in topics.values() for name, _ in members if len(name) <= COLUMNS), default=0)
    for topic, members in topics.items():
        if members:
            with formatter.section(topic):
                # all topics get the width of the widest name, which the library would measure anew for each
                formatter.write_dl([(name.ljust(widest), text) for name, text in members], col_max=widest)
