"""``proxbench check`` names the failed checks, survives faults of the checked solver, and returns an exit code."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.conformance import BRIEF_CHECKS, SOLVER_CHECKS
from proxbench.bench.conformance.run import run_checks
from proxbench.problems import PluginError
from proxbench.problems.exchange.plugins.offers import registered

WRAPPED = """
import os, time
from proxbench.problems import Model
from proxbench.solvers import create

class Wrapped:
    name, model = "Wrapped", Model.COULOMB
    def supports(self, problem):
        return None
    def prepare(self, problem):
        return Ready(create("SORprox").prepare(problem))

class Ready:
    def __init__(self, inner):
        self.inner = inner
    def solve(self, stop, start=None, observe=None):
        if CONDITION:
            FAULT
        return self.inner.solve(stop, start=start, observe=observe)

SOLVERS = [Wrapped]
"""


def plugin(folder: Path, fault: str, when: str = "stop.max_iterations == 10**9") -> str:
    """A file with a solver that has a fault, by default only in the check of the time limit."""
    path = folder / "wrapped.py"
    path.write_text(WRAPPED.replace("CONDITION", when).replace("FAULT", fault))
    return str(path)


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check solvers only on small problems."""
    monkeypatch.setattr("proxbench.bench.conformance.run.CHECKS", {"solver": BRIEF_CHECKS})


@pytest.mark.weekly
def test_a_conforming_solver_passes_and_its_plugin_is_unregistered(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["check", plugin(tmp_path, "pass")]) == 0
    printed = capsys.readouterr().out
    assert f"solver Wrapped from plugin file {tmp_path}/wrapped.py" in printed
    assert f"{len(SOLVER_CHECKS)} passed" in printed
    assert registered() == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "seconds", "words"),
    [
        ("os._exit(3)", 60.0, "its process ended with exit code 3"),
        pytest.param("os.abort()", 60.0, "killed by SIGABRT", marks=pytest.mark.weekly),
        pytest.param("time.sleep(1000)", 5.0, "it did not finish within 5 s", marks=pytest.mark.weekly),
        pytest.param(
            "raise ValueError('odd')",
            60.0,
            "it raised ValueError: odd (line 18 of wrapped.py)",
            marks=pytest.mark.weekly,
        ),
        pytest.param("[bytes(2**28) for _ in range(100)]", 60.0, "MiB of memory", marks=pytest.mark.weekly),
    ],
)
@pytest.mark.usefixtures("brief")
def test_a_fault_fails_only_its_own_check(fault: str, seconds: float, words: str, tmp_path: Path) -> None:
    (subject,) = run_checks(plugin(tmp_path, fault), seconds=seconds)
    results = {row["check"]: row for row in subject["checks"]}
    assert words in results.pop("time limit")["sentence"]
    assert {row["result"] for row in results.values()} == {"passed"}
    assert not subject["passed"]


@pytest.mark.slow
@pytest.mark.usefixtures("brief")
def test_failures_are_in_the_table_and_make_the_exit_code_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")  # sentences are wrapped at this width
    assert run_command(["check", plugin(tmp_path, "print('hello')", "True")]) == 1
    printed = capsys.readouterr().out
    assert "silent            failed          it printed 'hello'; report it in Solution.message." in printed
    assert f"{len(BRIEF_CHECKS) - 1} passed, 1 failed" in printed


@pytest.mark.weekly
@pytest.mark.usefixtures("brief")
def test_json_is_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "SORprox(relaxation=1.5)", "--json"]) == 0
    (subject,) = json.loads(capsys.readouterr().out)
    assert (subject["kind"], subject["name"], subject["passed"]) == ("solver", "SORprox(relaxation=1.5)", True)
    assert [row["check"] for row in subject["checks"]] == [check.name for check in BRIEF_CHECKS]
    assert all(row["promise"].endswith(".") for row in subject["checks"])


def test_every_check_is_announced_with_how_many_are_done() -> None:
    announced: list[tuple[str, int, int]] = []
    (subject,) = run_checks("hard-groove", on_check=lambda *what: announced.append(what))
    names = [row["check"] for row in subject["checks"]]
    assert announced == [(f"hard-groove: {name}", done, len(names)) for done, name in enumerate(names)]


def test_a_problem_can_be_checked() -> None:
    (subject,) = run_checks("hard-groove-frictionless")
    assert subject["kind"] == "problem"
    assert [row["result"] for row in subject["checks"]] == ["passed"] * 4


def test_a_problem_file_can_be_checked(tmp_path: Path) -> None:
    np.savez(tmp_path / "singular.npz", G=np.ones((3, 3)), c=[-1.0, 0.0, 0.0], mu=0.5)
    (subject,) = run_checks(str(tmp_path / "singular.npz"))
    assert subject["kind"] == "problem"
    assert [row["result"] for row in subject["checks"]] == ["passed"] * 3 + ["not applicable"]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.npz", None, "there is no problem file none.npz"),
        ("nan.npz", {"G": np.diag([1.0, np.nan, 1.0]), "c": np.ones(3), "mu": 0.5}, "G[1, 1] = nan must be finite"),
        ("indefinite.npz", {"G": np.diag([1.0, 1.0, -1.0]), "c": np.ones(3), "mu": 0.5}, "not positive semidefinite"),
        ("array.npy", b"\x93NUMPY\0", "array.npy is not a plugin file: it contains binary data; name a Python file."),
        ("library.so", b"\x7fELF\0", "check its solver as 'Shared(library.so)' or 'Executable(library.so)'."),
    ],
)
def test_a_file_that_cannot_be_checked_is_refused_with_the_cause(
    name: str,
    content: bytes | dict[str, Any] | None,
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    if isinstance(content, bytes):
        Path(name).write_bytes(content)
    elif content is not None:
        np.savez(name, **content)
    assert run_command(["check", name]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert words in printed.err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("check SORprx", "did you mean 'SORprox'"),
        ("check SORprox(relaxation=-1)", "relaxation"),
        ("check funel-30", "did you mean 'funnel-30'"),
        ("check SORprox --check-seconds 0", "must be positive"),
        ("check", "NAME|FILE"),
    ],
)
def test_errors_are_reported_in_one_sentence_with_exit_code_2(
    line: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(line.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert words in printed.err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "seconds", "words"),
    [
        ("import os; os._exit(9)", 60.0, "exit code 9"),
        pytest.param("while True: pass", 3.0, "it does not end within 3 s", marks=pytest.mark.weekly),
    ],
)
def test_a_file_that_crashes_or_hangs_when_imported_is_reported(
    text: str, seconds: float, words: str, tmp_path: Path
) -> None:
    (tmp_path / "bad.py").write_text(text)
    with pytest.raises(PluginError, match=words):
        run_checks(str(tmp_path / "bad.py"), seconds=seconds)
