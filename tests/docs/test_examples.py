"""Run the examples of the documentation: the blocks of each page run in order, in one namespace.

Python blocks are executed, prompts (``>>>``) compared with what they print, and every ``$ proxbench …`` line of a
console block is run in the page's own folder and must end with exit code 0; lines below a command are its output.
Commands run in this process, because imports and preparations for measurements take longer than most commands; the
plugins that they register are removed.
A text block shows lines that the last command above it prints, in their order. Times in µs, ms or seconds of wall time,
and residuals below 1e-14 (rounding) may differ; ``...`` replaces measured times without a unit.
``<!-- file: NAME -->`` before a Python block also writes it to that file; ``<!-- skip: next "REASON" -->`` skips a
block.
"""

import doctest
import io
import math
import os
import re
import shlex
from collections.abc import Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest import SkipTest

import pytest
from blank_pictures import draw_blank_pictures
from proxbench.bench.cli.main import run_command
from proxbench.bench.conformance import SOLVER_CHECKS
from proxbench.problems.exchange.plugins.offers import forget, registered
from sybil import Document, Example, Region
from sybil.parsers.myst import CodeBlockParser, PythonCodeBlockParser, SkipParser
from times_under_load import ignore_load

ROOT = Path(__file__).resolve().parents[2]
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
MEASURED = re.compile(r"(?:≈ )?[\d.]+ (?:µs|ms|s(?= wall| per simulated second))\*?")
ROUNDING = re.compile(r"\b\d(?:\.\d+)?e-(?:1[5-9]|[2-9]\d)\b")
IS_FULL = os.environ.get("PROXBENCH_PROFILE") == "full"
MAX_LINE_WIDTH = 96
"""Characters of code that fit on a page without scrolling."""


@pytest.fixture(autouse=True)
def _ignore_other_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exclude no rounds and add no notes on times, because other tests use the core; draw no charts."""
    ignore_load(monkeypatch)
    draw_blank_pictures(monkeypatch)
    monkeypatch.setattr("proxbench.bench.store.notes.EXPLAINED_RATIO", math.inf)


def run_console(example: Example) -> None:
    """Run the commands of a console block, and compare what they print with the lines below them, if there are any."""
    for command, expected in commands(example.parsed):
        program, *arguments = shlex.split(command)
        assert program == "proxbench", f"only proxbench is run; skip the block or mend {command!r}"
        code, printed, errors = outcome_of(arguments)
        assert code == 0, f"$ {command}\n{printed}{errors}"
        if expected:
            same = doctest.OutputChecker().check_output(expected, printed, FLAGS)
            assert same, f"$ {command}\nprints\n{printed}\nand not\n{expected}"
        example.namespace["last_printed"] = printed


def outcome_of(arguments: list[str]) -> tuple[int, str, str]:
    """Run a command; return its exit code, what it prints, and what it writes to standard error."""
    before = [file for file, _ in registered()]
    with (
        pytest.MonkeyPatch.context() as patch,
        redirect_stdout(io.StringIO()) as printed,
        redirect_stderr(io.StringIO()) as errors,
    ):
        patch.setenv("COLUMNS", "120")
        code = run_command(arguments)
    for file, _ in registered():
        if file not in before:
            forget(file)
    return code, printed.getvalue(), errors.getvalue()


def compare_sample(example: Example) -> None:
    """Compare a text block with what the last command printed."""
    printed = example.namespace.get("last_printed")
    assert printed is not None, "no command above this text prints it; skip the block and say where it comes from"
    missing = first_missing(comparable(example.parsed), comparable(printed))
    assert missing is None, f"the command prints no such line after those above it:\n{missing}\nit prints\n{printed}"


def comparable(text: str) -> list[str]:
    """Return the non-empty lines, without measured times and the widths that depend on them."""
    lines = (re.sub("─+", "─", ROUNDING.sub("…", MEASURED.sub("…", line))) for line in text.splitlines())
    return [" ".join(line.split()) for line in lines if line.strip()]


def first_missing(shown: Iterable[str], printed: Iterable[str]) -> str | None:
    """Return the first line of ``shown`` that does not occur in ``printed`` after its predecessors; None if all do."""
    rest = iter(printed)
    check = doctest.OutputChecker().check_output
    return next((line for line in shown if not any(check(line, candidate, FLAGS) for candidate in rest)), None)


def commands(block: str) -> Iterator[tuple[str, str]]:
    r"""Yield the commands after ``$`` in a console block, lines ending in ``\`` joined, each with its output."""
    assert block.startswith("$ "), "a console block begins with a command: $ proxbench …"
    for part in ("\n" + block).split("\n$ ")[1:]:
        command, _, output = part.replace("\\\n", " ").partition("\n")
        yield command, output


def file_comments(document: Document) -> Iterable[Region]:
    """Find the comments that name the file of the block below them."""
    for found in re.finditer(r"^<!-- file: ([\w.-]+) -->$", document.text, re.MULTILINE):
        yield Region(found.start(), found.end(), found[1], write_next_block)


def write_next_block(example: Example) -> None:
    """Write the Python block that follows into the file that its comment names."""
    rest = example.document.text[example.region.end :].lstrip()
    opening, _, block = rest.partition("\n")
    assert opening == "```python", f"{example.parsed} is named, but no Python block follows"
    Path(example.parsed).write_text(block.partition("\n```")[0] + "\n", encoding="utf-8")


def parsed(page: Path) -> Document:
    """Return a page with its examples."""
    parsers = (
        PythonCodeBlockParser(doctest_optionflags=FLAGS),
        CodeBlockParser("console", run_console),
        CodeBlockParser("text", compare_sample),
        file_comments,
        SkipParser(),
    )
    return Document.parse(str(page), *parsers)


def run_page(page: Path) -> int:
    """Run the examples of a page in the current folder; return how many were run."""
    count = 0
    for example in parsed(page).examples():
        try:
            example.evaluate()
            count += 1
        except SkipTest:
            pass
    return count


def pages_with_examples() -> list[str]:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [str(page.relative_to(ROOT)) for page in pages if any(True for _ in parsed(page).examples())]


LONG = (
    *("add-a-problem", "add-a-solver", "build-rigid-scenes", "choose-a-solver"),
    *(
        "measure-your-collection",
        "send-results",
        "show-a-run",
        "simulate-a-scene",
        "use-fclib",
        "watch-for-regressions",
    ),
)
"""Guides whose commands take more than six seconds, as do those of the tutorial, with which readers begin."""


def with_mark(page: str) -> Any:
    """Return a page as a parameter; a command that measures or simulates takes seconds."""
    if Path(page).stem in LONG:
        return pytest.param(page, marks=pytest.mark.weekly)
    has_commands = re.search(r"^\$ proxbench ", (ROOT / page).read_text("utf-8"), re.MULTILINE)
    is_slow = has_commands or Path(page).stem == "watch-an-iteration"  # it loads rerun
    return pytest.param(page, marks=[pytest.mark.slow] if is_slow else [])


@pytest.mark.parametrize("page", [with_mark(page) for page in pages_with_examples()])
def test_examples_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path / "cache"))
    if not IS_FULL:
        monkeypatch.setattr("proxbench.bench.store.plans.PASSES", 1)  # the second pass prints the same lines
    run_page(ROOT / page)


QUICKEST = (
    "interface",
    "pickling",
    "process",
    "finite",
    "truthful",
    "infeasible",
    "no contacts",
    "time limit",
    "silent",
)
"""Checks of the solver of the guide for new solvers in slow tests; weekly tests run all of them."""


@pytest.mark.slow
def test_examples_of_the_guide_for_new_solvers_run_with_the_quickest_checks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = [check for check in SOLVER_CHECKS if check.name in QUICKEST]
    assert len(checks) == len(QUICKEST)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("proxbench.bench.conformance.run.CHECKS", {"solver": checks})
    assert run_page(ROOT / "docs/how-to/add-a-solver.md") == 5


@pytest.mark.parametrize("page", [page for page in pages_with_examples() if page.startswith("docs/")])
def test_examples_fit_on_the_page(page: str) -> None:
    blocks = re.findall(
        r"^```(?:python|console|toml)\n(.*?)^```$", (ROOT / page).read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    assert [line for block in blocks for line in block.splitlines() if len(line) > MAX_LINE_WIDTH] == []


@pytest.mark.parametrize(
    ("wrong", "noticed"),
    [
        ("```python\n1 / 0\n```\n", "division by zero"),
        ("```python\n>>> 1 + 1\n3\n```\n", "Expected:\n    3\nGot:\n    2"),
        ("```console\n$ proxbench run --problem no-such-problem\n```\n", "there is no problem 'no-such-problem'"),
        ("```console\n$ proxbench --version\nproxbench of another name\n```\n", "proxbench of another name"),
        ("```console\n$ other-program\n```\n", "only proxbench is run"),
        ("```console\n$ proxbench --version\n```\n\n```text\nanother name\n```\n", "prints no such line"),
        ("```text\nfrom nowhere\n```\n", "no command above this text"),
    ],
    ids=[
        "error",
        "other value",
        "exit code",
        "other output",
        "other program",
        "other sample",
        "sample without command",
    ],
)
def test_a_wrong_example_is_noticed(wrong: str, noticed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"# A page\n\n{wrong}", encoding="utf-8")
    with pytest.raises(Exception, match=noticed):
        run_page(page)


def test_blocks_share_one_namespace_and_the_files_they_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- file: number.py -->\n```python\nnumber = 3\n```\n\n"
        "```python\n>>> number\n3\n>>> open('number.py').read()\n'number = 3\\n'\n```\n\n"
        '<!-- skip: next "it is wrong" -->\n```python\n1 / 0\n```\n',
        encoding="utf-8",
    )
    assert run_page(page) == 5


def test_samples_may_differ_in_measured_times_alone() -> None:
    shown = "a row   1.5 ms  1e-4  6e-16\n ────\n\ntotal  0.5 s in 9 steps, 6 s wall\n b  ...  2\n"
    printed = "\na row  90 µs  1e-4  3e-17\n ─────\nother\ntotal  0.5 s in 9 steps, 12.5 s wall\n b  0.3  2\n"
    assert first_missing(comparable(shown), comparable(printed)) is None
    for old, new in (("1e-4", "1e-5"), ("9 steps", "8 steps"), ("0.5 s in", "0.6 s in"), ("3  2", "3  4")):
        assert first_missing(comparable(shown), comparable(printed.replace(old, new))) is not None


@pytest.mark.parametrize("page", pages_with_examples())
def test_what_is_skipped_has_a_reason(page: str) -> None:
    skips = re.findall(r"^<!-- skip: .*$", (ROOT / page).read_text("utf-8"), re.MULTILINE)
    assert [skip for skip in skips if not re.fullmatch(r'<!-- skip: next ".+" -->', skip)] == []
