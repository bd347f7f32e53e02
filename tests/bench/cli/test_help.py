"""Help pages are short, fit a terminal, and their examples are command lines that the program accepts."""

import shlex

import pytest
from proxbench.bench.cli.main import app, run_command
from typer.core import TyperGroup
from typer.main import get_command

PROGRAM = get_command(app)
assert isinstance(PROGRAM, TyperGroup)
COMMANDS = PROGRAM.commands
PAGES = [(), *((name,) for name in COMMANDS)]
LONG = {"simulate"}
"""Pages that are longer than they should be."""


def page(command: tuple[str, ...], option: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert run_command([*command, option]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", PAGES)
def test_a_page_is_short_and_has_examples(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = page(command, "-h", capsys).splitlines()
    assert lines == page(command, "--help", capsys).splitlines()
    assert max(map(len, lines)) <= 80
    assert LONG.intersection(command) or len(lines) <= 40
    examples = lines[lines.index("Examples:") + 1 :]
    assert len(examples) >= 2
    assert all(line.startswith(f"  {' '.join(('proxbench', *command))} ") for line in examples)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_accepted(name: str) -> None:
    for line in (COMMANDS[name].epilog or "").splitlines():
        words = shlex.split(line)
        assert words[:2] == ["proxbench", name]
        COMMANDS[name].make_context(name, words[2:])  # raises an error for an unknown option or a missing value


def test_every_option_of_every_command_has_one_topic_and_a_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    for name, command in COMMANDS.items():
        words = page((name,), "-h", capsys).partition("Examples:")[0].split()
        for option in command.params:
            shown = [f"--[no-]{option.opts[0][2:]}" if option.secondary_opts else option.opts[0]]
            assert option.param_type_name == "argument" or words.count(shown[0]) >= 1
            assert getattr(option, "help", None)


def test_commands_stand_under_topics_of_their_own(capsys: pytest.CaptureFixture[str]) -> None:
    lines = page((), "-h", capsys).splitlines()
    topics = [line for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert len(topics) > 3
    assert topics[-2:] == ["Options:", "Examples:"]
    for name in COMMANDS:
        assert sum(line.startswith(f"  {name} ") for line in lines) == 1
