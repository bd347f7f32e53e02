"""The installed package agrees with the source tree, and importing problems loads few packages."""

import subprocess
import sys
import tomllib
from importlib import import_module, metadata, resources
from pathlib import Path

import proxbench
import pytest
from packaging.version import Version

ROOT = Path(__file__).parent.parent
PACKAGE_ROOT = "bench/package"
"""Folder of the package proxbench itself."""

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_every_package_of_the_tree_is_listed_for_installation() -> None:
    folders = {
        file.parent.relative_to(ROOT).as_posix()
        for top in ("problems", "solvers", "bench")
        for file in (ROOT / top).rglob("__init__.py")
    }
    places = {f"proxbench.{folder.replace('/', '.')}": folder for folder in folders - {PACKAGE_ROOT}}
    places["proxbench"] = PACKAGE_ROOT
    assert set(places) == set(PROJECT["tool"]["setuptools"]["packages"])
    assert places == PROJECT["tool"]["setuptools"]["package-dir"]


def test_package_contains_the_py_typed_marker() -> None:
    assert resources.files("proxbench").joinpath("py.typed").is_file()


def test_the_version_comes_from_tags_and_is_that_of_the_installation() -> None:
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert proxbench.__version__ == metadata.version("proxbench")
    assert Version(proxbench.__version__) >= Version(PROJECT["tool"]["setuptools_scm"]["fallback_version"])


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("ContactProblem", "proxbench.problems.contact.problem"),
        ("judge", "proxbench.problems.contact.judge"),
        ("load", "proxbench.problems.exchange.catalog"),
        ("run", "proxbench.bench.runs"),
        ("solve", "proxbench.solvers.registry"),
        ("solve_many", "proxbench.solvers.composite.small.solve_many"),
    ],
)
def test_the_package_offers_a_name_as_its_module_defines_it(name: str, place: str) -> None:
    assert getattr(proxbench, name) is getattr(import_module(place), name)


def test_dir_shows_the_names_and_subpackages_of_the_package() -> None:
    names = {"ContactProblem", "__version__", "judge", "load", "run", "solve", "solve_many"}
    assert set(proxbench.__all__) == names
    assert set(dir(proxbench)) == names | {"bench", "problems", "solvers"}
    assert all(hasattr(proxbench, name) for name in dir(proxbench))


def test_an_unknown_name_of_the_package_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'proxbench' has no attribute 'nosuch'"):
        proxbench.nosuch  # noqa: B018


def test_the_package_runs_as_the_command_line(tmp_path: Path) -> None:
    # not in the tree, whose egg-info may be of another version
    command = [sys.executable, "-m", "proxbench", "--version"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == f"proxbench {proxbench.__version__}\n"


def test_a_problem_is_solved_and_judged_with_the_package_alone() -> None:
    problem = proxbench.ContactProblem.from_delassus([[1.0]], [-2.0], dim=1)
    solution = proxbench.solve(problem, "SORprox", tolerance=1e-8)
    assert solution.impulses == pytest.approx([2.0])
    assert proxbench.judge(problem, solution.impulses).residual <= 1e-8


@pytest.mark.parametrize(
    "imports",
    [
        {
            "proxbench": {"numpy", "numba", "scipy", "pandas", "typer", "msgspec"},
            "proxbench.bench": {"numba", "scipy", "clarabel", "pandas", "altair", "rerun"},
            "proxbench.problems": {"h5py", "cvxpy", "clarabel", "rerun", "pandas", "altair", "rich", "typer"},
            "proxbench.solvers": {"cvxpy", "clarabel", "rerun", "pandas", "altair", "rich", "typer"},
        },
        {
            "proxbench.bench.cli.main": {"numba", "scipy", "clarabel", "pandas", "altair", "rerun"},
            "proxbench.bench.cli.listing": {
                *("scipy.linalg", "scipy.special", "clarabel", "pandas", "altair", "rerun"),
            },
            "proxbench.bench.runs": {
                *("scipy.stats", "scipy.spatial", "scipy.integrate", "cvxpy", "altair", "rerun"),
            },
        },
    ],
    ids=["library", "command line"],
)
def test_importing_loads_no_more_than_it_needs(imports: dict[str, set[str]]) -> None:
    """Each process imports some modules one after the other, and what one of them loads also counts for the next."""
    code = f"""
import importlib, sys
for module, heavy in {imports!r}.items():
    importlib.import_module(module)
    print(module, sorted(heavy & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [f"{module} []" for module in imports]


@pytest.mark.slow
def test_importing_the_run_of_benchmarks_loads_no_kernel() -> None:
    code = """
import gc, proxbench.bench.runs
from numba.core.dispatcher import Dispatcher
kernels = [one for one in gc.get_objects() if isinstance(one, Dispatcher)]
print(len(kernels) > 100, [one.py_func.__name__ for one in kernels if one.signatures])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True []"


def test_the_names_that_scripts_rely_on_exist() -> None:
    from proxbench import bench, problems, solvers

    assert {"ContactProblem", "ProblemError", "judge", "load", "suite"} <= set(problems.__all__)
    assert {"create", "available", "solve", "Stop", "Status"} <= set(solvers.__all__)
    assert callable(bench.run)
    assert callable(bench.load)
