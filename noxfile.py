"""The sessions of nox, each with its own environment: ``nox -s tests``, ``nox -s bench``, …"""

import filecmp
import hashlib
import os
import shutil
from pathlib import Path

import nox

nox.options.sessions = ["tests", "lint", "types"]
nox.options.reuse_existing_virtualenvs = True

STYLE = ("ruff>=0.11",)
MUTATING = ("cosmic-ray>=8.4", "pytest-timeout>=2.3")
PROGRAMS = tuple(f"tests/speed/{name}.py" for name in ("contestants", "figures", "known_solvers", "pair"))
TYPING = ("mypy>=1.15", "scipy-stubs", "pandas-stubs", "types-psutil")
ON_ALL_CORES = ("-n", "auto", "--dist", "loadfile", "--no-loadscope-reorder")
"""Distribute test files in the given order: by their number of tests, some long ones would be last."""


def _keep_compiled_kernels(session: nox.Session) -> None:
    """Let numba keep compiled kernels in the folder of the session, which finds those with unchanged sources again."""
    environment = Path(session.virtualenv.location)
    session.env["NUMBA_CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", str(environment / "numba"))


def _share_compiled_kernels(session: nox.Session, other: str) -> None:
    """Link the kernels that the session ``other`` has compiled, if both keep them in one folder.

    They are the same, but numba keeps those of a package in a folder that is named by the package's path.
    """
    cache = Path(session.env["NUMBA_CACHE_DIR"])
    environment = Path(session.virtualenv.location).absolute()
    for package in {path.parent for path in environment.glob("lib/python*/site-packages/proxbench/**/*.py")}:
        twin = environment.with_name(other) / package.relative_to(environment)
        digests = [hashlib.sha1(str(path).encode()).hexdigest() for path in (package, twin)]
        link, kernels = (cache / f"{package.name}_{digest}" for digest in digests)
        if kernels.is_dir() and not link.exists():
            link.symlink_to(kernels.name)


@nox.session
def tests(session: nox.Session) -> None:
    """Run the daily tests against an installed package, on all cores.

    After it ``nox -R -s tests -- -m "slow and not weekly"`` runs the slow tests in the same environment, and
    ``-m weekly`` those that repeat them over more solvers, cases, faults and samples.
    """
    session.install(".[test,dask]")
    _keep_compiled_kernels(session)
    session.run("pytest", *ON_ALL_CORES, "-m", "not slow", *session.posargs)  # the last folders are quick


@nox.session
def peers(session: nox.Session) -> None:
    """Test external solvers, devices of Warp, captures, engines, writers and contacts of coal, each with its extra.

    Files of which no test needs an extra are left to the daily tests.
    """
    session.install(".[test,peers,kamino,mujoco,engines,bodies,gpu]")
    _keep_compiled_kernels(session)
    _share_compiled_kernels(session, "tests")
    captures = (
        "tests/speed/test_captured_models.py",
        "tests/problems/capture",
        "tests/bench/cli/test_capture_command.py",
    )
    engines = [f"tests/bench/measure/trajectories/engines/test_{name}.py" for name in ("installed_engines", "run")]
    shapes = [f"tests/problems/motion/detection/test_{name}.py" for name in ("coal_contacts", "round_bodies")]
    shapes.append("tests/problems/motion/bodies/rigid/test_shapes_in_motion.py")
    warp, writers = "tests/solvers/prox/test_warp_sorprox.py", "tests/docs/test_engine_writers.py"
    paths = (warp, *captures, *engines, writers, "tests/solvers/peers", *shapes)
    session.run("pytest", *ON_ALL_CORES, *paths, *session.posargs)


@nox.session
def coverage(session: nox.Session) -> None:
    """Measure which lines the daily tests run, compiled kernels apart, and write a report into build/coverage."""
    session.install(".[test,dask]", "pytest-cov>=5")
    _keep_compiled_kernels(session)
    report = ("--cov", "--cov-report=term:skip-covered", "--cov-report=html:build/coverage")
    session.run("pytest", "-n", "auto", "-m", "not slow", *report, *session.posargs)


@nox.session
def bench(session: nox.Session) -> None:
    """Measure the quick suite, print the tables, and write them and a page of charts into results/."""
    session.install(".")
    _keep_compiled_kernels(session)
    session.run("proxbench", "run", *session.posargs)


@nox.session
def speed(session: nox.Session) -> None:
    """Compare twelve speeds with those of accepted commits; with arguments for pytest, take those of tests/speed."""
    session.install(".[test]")
    _keep_compiled_kernels(session)
    if session.posargs:
        session.run("pytest", "--benchmark-only", *session.posargs)
    else:
        session.run("python", "tests/speed/pair.py")


@nox.session
def mutants(session: nox.Session) -> None:
    """Find small changes to a copy of the code that no daily test notices; see tests/mutants.py.

    ``nox -s mutants -- --sample 20 --seed 1 problems/contact`` tries 20 places of one folder, which takes minutes; all
    changes of all folders take days. Results are kept in the session's folder, and the next call continues from them.
    """
    tree = Path(session.create_tmp()) / "tree"
    listed = session.run("git", "ls-files", "--cached", "--others", "--exclude-standard", external=True, silent=True)
    names = str(listed).splitlines()
    for module in {path for path in tree.rglob("*.py")} - {tree / name for name in names}:
        module.unlink()  # deleted or renamed in the source
    for name in names:
        source, copy = Path(name), tree / name
        if source.is_file() and not (copy.exists() and filecmp.cmp(source, copy, shallow=False)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, copy)
    session.install("-e", f"{tree}[test,dask]", *MUTATING)
    session.env.update({"NUMBA_CACHE_DIR": str(tree / "numba"), "OMP_NUM_THREADS": "1"})
    with session.chdir(tree):
        session.run("python", "tests/mutants.py", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Check format and style."""
    session.install(*STYLE)
    _check_style(session)


@nox.session
def types(session: nox.Session) -> None:
    """Check types, strictly, in the three packages as installed and in the programs among the tests."""
    session.install(".[test]", *TYPING)
    _check_types(session)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the site into build/docs, warnings as errors."""
    session.install(".[docs]")
    _build_site(session)


@nox.session
def checks(session: nox.Session) -> None:
    """Check style and types and build the site, in one environment: installing takes longer than each of them.

    Notebooks are not executed; a slow test does that.
    """
    session.install(*STYLE)
    _check_style(session)
    session.install(".[test,docs]", *TYPING)
    _check_types(session)
    _build_site(session, "-D", "nb_execution_mode=off")


def _check_style(session: nox.Session) -> None:
    session.run("ruff", "format", "--check", ".")
    session.run("ruff", "check", ".")


def _check_types(session: nox.Session) -> None:
    session.run("mypy", "-p", "proxbench")
    session.run("mypy", *PROGRAMS)


def _build_site(session: nox.Session, *options: str) -> None:
    session.run("sphinx-build", "-W", "--keep-going", "-j", "auto", *options, "-b", "html", "docs", "build/docs")
