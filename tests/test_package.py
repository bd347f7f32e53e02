"""What is installed is what the tree holds, and importing problems is light."""

import subprocess
import sys
import tomllib
from importlib import metadata, resources
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_every_package_of_the_tree_is_listed_for_installation() -> None:
    folders = {
        "proxbench." + str(file.parent.relative_to(ROOT)).replace("/", ".")
        for top in ("problems", "solvers", "bench")
        for file in (ROOT / top).rglob("__init__.py")
    }
    assert folders == set(PROJECT["tool"]["setuptools"]["packages"])
    mapped = PROJECT["tool"]["setuptools"]["package-dir"]
    assert mapped == {name: name.removeprefix("proxbench.").replace(".", "/") for name in folders}


@pytest.mark.parametrize("package", ["problems", "solvers", "bench"])
def test_types_are_shipped(package: str) -> None:
    assert resources.files(f"proxbench.{package}").joinpath("py.typed").is_file()


def test_the_installed_version_is_that_of_the_project() -> None:
    assert metadata.version("proxbench") == PROJECT["project"]["version"]


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("proxbench.problems", {"h5py", "cvxpy", "clarabel", "rerun", "pandas", "altair", "rich", "typer"}),
        ("proxbench.solvers", {"cvxpy", "clarabel", "rerun", "pandas", "altair", "rich", "typer"}),
        ("proxbench.bench", {"numba", "scipy", "clarabel", "pandas", "altair", "rerun"}),
        ("proxbench.bench.cli.main", {"numba", "scipy", "clarabel", "pandas", "altair", "rerun"}),
    ],
)
def test_importing_loads_no_more_than_it_needs(module: str, heavy: set[str]) -> None:
    code = f"import sys, {module}; print(sorted({heavy!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_names_that_scripts_rely_on_exist() -> None:
    from proxbench import bench, problems, solvers

    assert {"ContactProblem", "ProblemError", "judge", "load", "suite"} <= set(problems.__all__)
    assert {"create", "available", "solve", "Stop", "Status"} <= set(solvers.__all__)
    assert callable(bench.run)
    assert callable(bench.load)
