"""A pytest plugin that runs each conformance check on each marked solver as a separate test.

Name this module in ``pytest_plugins`` of a ``conftest.py``, or load it with ``-p``, and mark a test with solvers or
their names. The test runs once for each solver and each check::

    @pytest.mark.proxbench(MySolver(), "MySolver(relaxation=0.5)")
    def test_conformance(proxbench_check):
        proxbench_check()

A check that does not apply to a solver is skipped, with the reason.
"""

from collections.abc import Callable

import pytest

from ...solvers.registry import create
from .checks import NotApplicable, Violation
from .solver_checks import SOLVER_CHECKS

FIXTURE = "proxbench_check"
"""Name of the fixture that returns a check."""


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", "proxbench(*solvers): test solvers, or names of solvers, for conformance.")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize the test over solvers and checks."""
    if FIXTURE not in metafunc.fixturenames:
        return
    solvers = [solver for mark in metafunc.definition.iter_markers("proxbench") for solver in mark.args]
    if not solvers:
        raise pytest.UsageError(
            f"{metafunc.definition.nodeid} uses {FIXTURE} without a solver; mark it: @pytest.mark.proxbench(MySolver())"
        )
    pairs = [(solver, check) for solver in solvers for check in SOLVER_CHECKS]
    names = [f"{getattr(solver, 'name', solver)}-{check}" for solver, check in pairs]
    metafunc.parametrize(FIXTURE, pairs, ids=names, indirect=True)


@pytest.fixture
def proxbench_check(request: pytest.FixtureRequest) -> Callable[[], None]:
    """Return one check of one solver as a function without arguments."""
    solver, check = request.param

    def run_check() -> None:
        try:
            check.run(create(solver) if isinstance(solver, str) else solver)
        except NotApplicable as reason:
            pytest.skip(str(reason))
        except Violation as violation:
            pytest.fail(str(violation), pytrace=False)

    return run_check
