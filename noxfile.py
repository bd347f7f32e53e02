"""Every chore of the project, each with its own environment: ``nox -s tests``, ``nox -s bench``, …"""

import os
from pathlib import Path

import nox

nox.options.sessions = ["tests", "lint", "types"]
nox.options.reuse_existing_virtualenvs = True

PACKAGES = ("problems", "solvers", "bench")


def _keep_compiled_kernels(session: nox.Session) -> None:
    """Let numba keep compiled kernels in the session's folder, so that reinstalling does not compile them again."""
    session.env["NUMBA_CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", str(Path(session.virtualenv.location) / "numba"))


@nox.session
def tests(session: nox.Session) -> None:
    """Run the test suite against an installed package."""
    session.install(".[test]")
    _keep_compiled_kernels(session)
    session.run("pytest", "--ignore=tests/speed", *session.posargs)


@nox.session
def bench(session: nox.Session) -> None:
    """Measure the quick suite, print the tables, and write tables and charts into results/."""
    session.install(".")
    _keep_compiled_kernels(session)
    session.run("proxbench", "run", *session.posargs)


@nox.session
def speed(session: nox.Session) -> None:
    """Run the pytest-benchmark suite."""
    session.install(".[test]")
    _keep_compiled_kernels(session)
    session.run("pytest", "tests/speed", "--benchmark-only", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Check format and style."""
    session.install("ruff>=0.11")
    session.run("ruff", "format", "--check", ".")
    session.run("ruff", "check", ".")


@nox.session
def types(session: nox.Session) -> None:
    """Check types, strictly, in the three packages as installed."""
    session.install(".", "mypy>=1.15", "scipy-stubs", "pandas-stubs", "types-psutil")
    session.run("mypy", *(word for package in PACKAGES for word in ("-p", f"proxbench.{package}")))


@nox.session
def docs(session: nox.Session) -> None:
    """Build the site into build/docs, warnings as errors."""
    session.install(".[docs]")
    session.run("sphinx-build", "-W", "--keep-going", "-b", "html", "docs", "build/docs")
