"""Conformance tests: requirements on every solver, regardless of its method, and on every problem.

``proxbench check`` runs them on a plugin, each in a process that may crash or hang. A test suite runs them directly::

    @pytest.mark.parametrize("check", SOLVER_CHECKS, ids=str)
    def test_my_solver_conforms(check):
        check.run(MySolver())
"""

from .checks import Check, NotApplicable, Violation
from .problem_checks import PROBLEM_CHECKS
from .solver_checks import BRIEF_CHECKS, SOLVER_CHECKS

__all__ = ["BRIEF_CHECKS", "PROBLEM_CHECKS", "SOLVER_CHECKS", "Check", "NotApplicable", "Violation"]
