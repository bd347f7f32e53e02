"""The worked examples of the documentation, installed as packages, are available everywhere without an option."""

import contextlib
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[3] / "docs" / "how-to"
SOLVER_LINES = 20


class Answer(NamedTuple):
    """The exit code of a command line, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


Command = Callable[..., Answer]


def block(page: str, language: str) -> str:
    """Return the first code block of a language on a page."""
    found = re.search(rf"^```{language}\n(.*?)^```$", (DOCS / page).read_text(encoding="utf-8"), re.M | re.S)
    assert found is not None
    return found.group(1)


def build_wheel(folder: Path, project: str, modules: dict[str, str]) -> Path:
    """Write a wheel of single-file modules directly, so that neither setuptools nor a network is needed."""
    about = tomllib.loads(project)["project"]
    label = f"{about['name'].replace('-', '_')}-{about['version']}"
    info = f"{label}.dist-info"
    groups = [
        "\n".join([f"[{group}]", *(f"{name} = {target}" for name, target in points.items())])
        for group, points in about["entry-points"].items()
    ]
    files = {
        **{f"{name}.py": text for name, text in modules.items()},
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": "\n\n".join(groups) + "\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    wheel = folder / f"{label}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return wheel


SERVE = """
import contextlib, io, json, sys
from proxbench.bench.cli.main import run_command
from proxbench.bench.conformance import run

run.CHECKS = {kind: checks[:4] for kind, checks in run.CHECKS.items()}
for line in sys.stdin:
    with contextlib.redirect_stdout(io.StringIO()) as output, contextlib.redirect_stderr(io.StringIO()) as errors:
        code = run_command(json.loads(line))
    print(json.dumps([code, output.getvalue(), errors.getvalue()]), flush=True)
"""
"""Program of a process that runs command lines, with four checks of each kind; the page of the solver runs all."""


@contextlib.contextmanager
def command_with(*wheels: Path, site: Path) -> Iterator[Command]:
    """Install wheels into a new folder; yield the command line of a process that imports from it."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-compile"]
    environment = {**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    subprocess.run([*pip, "--target", str(site), *map(str, wheels)], check=True, timeout=600, env=environment)
    path = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200"}  # names are not wrapped
    server = subprocess.Popen(
        [sys.executable, "-c", SERVE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )
    assert server.stdin is not None
    assert server.stdout is not None
    requests, answers = server.stdin, server.stdout

    def command(*words: str) -> Answer:
        print(json.dumps(words), file=requests, flush=True)
        return Answer(*json.loads(answers.readline()))

    try:
        yield command
    finally:
        server.communicate()


@pytest.fixture(scope="module")
def proxbench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Command]:
    """Yield the command line in an environment with both worked examples installed."""
    folder = tmp_path_factory.mktemp("packages")
    solver = build_wheel(
        folder, block("add-a-solver.md", "toml"), {"fixed_step_gradient": block("add-a-solver.md", "python")}
    )
    problem = build_wheel(folder, block("add-a-problem.md", "toml"), {"bricks": block("add-a-problem.md", "python")})
    with command_with(solver, problem, site=folder / "site") as command:
        yield command


def test_the_worked_solver_has_at_most_twenty_lines() -> None:
    lines = [line for line in block("add-a-solver.md", "python").splitlines() if line.strip()]
    assert len(lines) <= SOLVER_LINES


def test_solver_and_problem_are_listed_with_their_package(proxbench: Command) -> None:
    listed = json.loads(proxbench("list", "--json").stdout)
    solver = next(row for row in listed["solvers"] if row["name"] == "FixedStepGradient")
    assert solver["source"] == "package fixed-step-gradient 1.0"
    assert (solver["model"], solver["options"], solver["error"]) == ("coulomb", ["relaxation=1.0"], "")
    problem = next(row for row in listed["problems"] if row["name"] == "brick-on-slope")
    assert problem["source"] == "package bricks 1.0"
    assert (problem["contacts"], problem["rows"], problem["available"]) == (2, 4, True)


@pytest.mark.weekly
def test_solver_and_problem_of_a_package_are_run_and_recorded(proxbench: Command, tmp_path: Path) -> None:
    name = "FixedStepGradient(relaxation=1.5)"
    line = ["run", "--problem", "brick-on-slope", "--problem", "hard-sticking-box", "--solver", name]
    less = ["--tolerance", "1e-2", "--passes", "1", "--no-charts", "--no-page"]
    done = proxbench(*line, "--solver", "SORprox", *less, "--output", str(tmp_path), "--run-id", "one")
    assert done.returncode == 0, done.stderr
    assert "brick-on-slope · 2 contacts" in done.stdout
    assert done.stdout.count(name) >= 3
    document = json.loads(proxbench("report", str(tmp_path / "one"), "--json").stdout)
    assert {row["outcome"] for row in document["results"]} == {"solved"}
    assert len(document["results"]) == 4
    sources = {entry["name"]: entry["source"] for entry in document["info"]["plugins"]}
    assert sources == {
        "FixedStepGradient": "package fixed-step-gradient 1.0",
        "brick-on-slope": "package bricks 1.0",
    }


@pytest.mark.parametrize("target", ["FixedStepGradient(relaxation=1.5)", "brick-on-slope"])
def test_solver_and_problem_of_a_package_can_be_checked_by_name(proxbench: Command, target: str) -> None:
    done = proxbench("check", target, "--json")
    assert done.returncode == 0, done.stdout
    (subject,) = json.loads(done.stdout)
    assert subject["name"] == target
    results = [row["result"] for row in subject["checks"]]
    assert set(results) <= {"passed", "not applicable"}
    assert results[:3] == ["passed"] * 3


def test_problem_of_a_package_is_recorded_with_its_solver(proxbench: Command, tmp_path: Path) -> None:
    file = tmp_path / "a.rrd"
    done = proxbench("record", "brick-on-slope", "--solver", "FixedStepGradient", "--output", str(file))
    assert done.returncode == 0, done.stderr
    assert "FixedStepGradient: " in done.stdout
    assert file.is_file()


def test_the_worked_problem_is_generated(proxbench: Command, tmp_path: Path) -> None:
    done = proxbench("generate", "brick-on-slope", "--output", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "brick-on-slope.npz").is_file()


@pytest.mark.weekly
def test_names_that_are_not_free_and_packages_that_do_not_import_are_listed_with_their_error(tmp_path: Path) -> None:
    def project(name: str, points: str) -> str:
        return f'[project]\nname = "{name}"\nversion = "2.0"\n[project.entry-points."proxbench.solvers"]\n{points}\n'

    good = block("add-a-solver.md", "python").replace("FixedStepGradient", "Same")
    first = build_wheel(tmp_path, project("first", 'Same = "first:Same"\nSORprox = "first:Same"'), {"first": good})
    second = build_wheel(
        tmp_path,
        project("second", 'Same = "second:Same"\nGone = "no_such_module:Gone"\nText = "second:TEXT"'),
        {"second": good + "TEXT = 'abc'\n"},
    )
    with command_with(first, second, site=tmp_path / "site") as proxbench:
        check_errors(proxbench, tmp_path / "results")


def check_errors(proxbench: Command, results: Path) -> None:
    """Check that faulty packages are listed and refused by name, and do not affect other solvers."""
    done = proxbench("list", "solvers", "--json")
    assert done.returncode == 0
    rows = json.loads(done.stdout)["solvers"]
    errors = {(row["name"], row["source"]): row["error"] for row in rows if row["error"]}
    one, two = "package first 2.0", "package second 2.0"
    assert errors[("SORprox", one)] == (
        f"{one} offers the solver 'SORprox', a name that Proxbench itself uses; give it another name."
    )
    assert errors[("Same", one)] == (
        f"{one} offers the solver 'Same', and {two} offers the same name; rename or remove one of them."
    )
    assert "which fails to import: ModuleNotFoundError: No module named 'no_such_module'" in errors[("Gone", two)]
    assert errors[("Text", two)].startswith(f"solver Text of {two} is a str; provide the class")
    assert sum(row["name"] == "SORprox" and not row["error"] for row in rows) == 1
    for name in ("Same", "Gone", "Text"):
        done = proxbench("run", "--solver", name, "--output", str(results))
        assert done.returncode == 2
        assert done.stderr.strip() in {f"proxbench: {error}" for error in errors.values()}
    assert proxbench("check", "SORprox").returncode == 0
