"""The directive ``command-help``: the help of every command of ``proxbench``, as the installed version prints it."""

import os
import subprocess
import sys

from docutils import nodes
from docutils.parsers.rst import Directive
from proxbench.bench.cli.main import app as command_line
from sphinx.application import Sphinx

WIDTH = 80


def _help(*command: str) -> str:
    program = "import sys; from proxbench.bench.cli.main import main; sys.argv[0] = 'proxbench'; main()"
    done = subprocess.run(
        [sys.executable, "-c", program, *command, "--help"],
        env={**os.environ, "COLUMNS": str(WIDTH), "NO_COLOR": "1", "PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    return done.stdout.strip()


class CommandHelp(Directive):
    """The page of the program, and one section a command in its order."""

    def run(self) -> list[nodes.Node]:
        """Return the page and the sections."""
        sections: list[nodes.Node] = [nodes.literal_block(text=_help(), language="none")]
        for command in command_line.registered_commands:
            assert command.callback is not None
            name = command.name or command.callback.__name__
            section = nodes.section(ids=[f"proxbench-{name}"])
            section += nodes.title(text=f"proxbench {name}")
            section += nodes.literal_block(text=_help(name), language="none")
            sections.append(section)
        return sections


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
