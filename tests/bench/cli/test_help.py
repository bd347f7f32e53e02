"""Help pages are short, fit a terminal, and their examples are command lines that the program accepts."""

import re
import shlex

import pytest
from proxbench.bench.cli.main import app, run_command
from typer.core import TyperGroup
from typer.main import get_command

PROGRAM = get_command(app)
assert isinstance(PROGRAM, TyperGroup)
COMMANDS = {
    **{(name,): command for name, command in PROGRAM.commands.items()},
    **{
        (name, part): command
        for name, group in PROGRAM.commands.items()
        if isinstance(group, TyperGroup)
        for part, command in group.commands.items()
    },
}
PAGES = [(), *COMMANDS]
MAX_LINES = 66


def page(command: tuple[str, ...], option: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert run_command([*command, option]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", PAGES)
def test_a_page_is_short_and_has_examples(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    lines = [line.strip() for line in page(command, "-h", capsys).rstrip().splitlines()]
    assert lines == [line.strip() for line in page(command, "--help", capsys).rstrip().splitlines()]
    assert max(map(len, lines)) <= 80
    assert len(lines) <= MAX_LINES
    examples = lines[lines.index("Examples:") + 1 :]
    assert len(examples) >= 2
    assert all(line.startswith(f"{' '.join(('proxbench', *command))} ") for line in examples)


@pytest.mark.parametrize("command", PAGES)
def test_a_page_names_no_python_types(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    options = page(command, "-h", capsys).partition("Examples:")[0]
    assert not re.findall(r"<[a-z]\w*[|\[\]\w]*>", options)


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_are_accepted(command: tuple[str, ...]) -> None:
    for line in (COMMANDS[command].epilog or "").splitlines()[1:]:
        words, size = shlex.split(line), len(command) + 1
        assert words[:size] == ["proxbench", *command]
        inner = (*command, words[size])
        parsed, size = (COMMANDS[inner], size + 1) if inner in COMMANDS else (COMMANDS[command], size)
        parsed.make_context(words[size - 1], words[size:])  # raises an error for an unknown option or a missing value


@pytest.mark.slow
def test_every_option_of_every_command_has_a_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for name, command in COMMANDS.items():
        words = page(name, "-h", capsys).partition("Examples:")[0].split()
        for option in command.params:
            assert option.param_type_name == "argument" or words.count(option.opts[0]) >= 1
            assert getattr(option, "help", None)


def test_each_command_is_listed_once_under_a_topic(capsys: pytest.CaptureFixture[str]) -> None:
    lines = page((), "-h", capsys).splitlines()
    topics = [line.strip("╭─╮ ") for line in lines if line.startswith("╭")]
    assert topics[0] == "Options"
    assert len(topics) > 4
    for name in PROGRAM.commands:
        assert sum(line.startswith(f"│ {name} ") for line in lines) == 1


def test_calling_without_a_command_prints_the_help_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command([]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "Usage: proxbench" in printed.err
