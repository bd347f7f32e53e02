"""The directive ``command-help``: the help of every command of ``proxbench``, as the installed version prints it."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence

from docutils import nodes
from docutils.parsers.rst import Directive
from proxbench.bench.cli.main import app as command_line
from sphinx.application import Sphinx
from typer import Typer

PLAIN = {"COLUMNS": "80", "NO_COLOR": "1", "_TYPER_FORCE_DISABLE_TERMINAL": "1", "PYTHONIOENCODING": "utf-8"}
"""Variables that make help plain text: typer draws for a terminal where GITHUB_ACTIONS is set."""


PROGRAM = """
import json, sys
from contextlib import redirect_stdout
from io import StringIO
from proxbench.bench.cli.main import run_command

texts = []
for words in json.loads(sys.argv[1]):
    with redirect_stdout(StringIO()) as text:
        assert run_command([*words, "--help"]) == 0
    texts.append(text.getvalue().strip())
print(json.dumps(texts))
"""
"""A program that prints the help of commands, whose words are its argument."""


def _helps(commands: Sequence[tuple[str, ...]]) -> list[str]:
    """Return the help of each command, from one process, because importing the command line takes long."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(commands)],
        env=os.environ | PLAIN,
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    texts: list[str] = json.loads(done.stdout)
    return texts


class CommandHelp(Directive):
    """The page of the program, and one section per command."""

    def run(self) -> list[nodes.Node]:
        """Return the page and the sections."""
        paths = list(_commands(command_line))
        whole, *texts = _helps([(), *paths])
        sections: list[nodes.Node] = [nodes.literal_block(text=whole, language="none")]
        return sections + [_section(path, text) for path, text in zip(paths, texts, strict=True)]


def _commands(app: Typer, *path: str) -> Iterator[tuple[str, ...]]:
    """Yield the words of every command, with groups before their commands."""
    for command in app.registered_commands:
        assert command.callback is not None
        yield *path, command.name or command.callback.__name__
    for group in app.registered_groups:
        assert group.typer_instance is not None
        name = str(group.name)
        yield *path, name
        yield from _commands(group.typer_instance, *path, name)


def _section(path: tuple[str, ...], text: str) -> nodes.section:
    section = nodes.section(ids=["-".join(("proxbench", *path))])
    section += nodes.title(text=" ".join(("proxbench", *path)))
    section += nodes.literal_block(text=text, language="none")
    return section


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
