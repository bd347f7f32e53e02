"""Without its library an external solver is refused with instructions to install it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.solvers import SolverError, available, create
from proxbench.solvers.peers import installed
from proxbench.solvers.registry import peers

LIBRARIES = {"MuJoCo": ("mujoco", "mujoco"), "KaminoPADMM": ("newton", "kamino")}
"""Library and extra of each solver that does not need Pinocchio."""


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installed, "find_spec", lambda module: None)


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("name", peers())
def test_the_sentence_names_solver_library_and_command(name: str) -> None:
    library, extra = LIBRARIES.get(name, ("pinocchio", "peers"))
    with pytest.raises(
        SolverError, match=rf'{name} needs {library}, which is not installed; run pip install "\.\[{extra}\]"'
    ):
        create(name)


@pytest.mark.parametrize(("name", "version", "tried"), [("MuJoCo", "4.1.0", "4.0"), ("KaminoPADMM", "1.9.0", "1.8")])
def test_another_version_is_refused(name: str, version: str, tried: str, monkeypatch: pytest.MonkeyPatch) -> None:
    library, extra = LIBRARIES[name]
    monkeypatch.setattr(installed, "find_spec", lambda module: module)
    monkeypatch.setattr(installed.metadata, "version", lambda distribution: version)
    words = re.escape(f'does not support {library} {version}, only {tried}.x; run pip install ".[{extra}]"')
    with pytest.raises(SolverError, match=words):
        create(name)


@pytest.mark.usefixtures("bare")
def test_listed_solvers_show_the_missing_library(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", "solvers", "PinocchioADMM"]) == 0
    assert 'pinocchio, which is not installed; run pip install ".[peers]" in a clone of proxbench' in " ".join(
        capsys.readouterr().out.split()
    )


@pytest.mark.usefixtures("bare")
def test_a_run_with_a_missing_solver_is_refused_before_it_begins(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(["run", "--problem", "funnel-30", "--solver", "PinocchioPGS"]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "pip install" in printed.err
    assert list(tmp_path.iterdir()) == []


def test_external_solvers_are_not_among_the_available_ones() -> None:
    assert not set(peers()) & set(available())


@pytest.mark.slow
def test_listing_external_solvers_imports_no_library() -> None:
    code = (
        "import sys; from proxbench.bench.cli.main import run_command; run_command(['list', 'solvers']); "
        "sys.exit(not {'pinocchio', 'mujoco', 'newton', 'warp'}.isdisjoint(sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0
