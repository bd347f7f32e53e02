"""The part of ``proxbench check`` that runs in a child process; only this part runs code of a plugin."""

from dataclasses import dataclass
from functools import partial
from typing import Any

from ...problems.errors import ProxbenchError, first_line, raised_at
from ...problems.exchange.catalog import load
from ...solvers.registry import create
from ..isolation.child import MisbehaviourError
from ..isolation.process_state import ProcessState, replacement_text
from .checks import Check, NotApplicable, Violation
from .problem_checks import PROBLEM_CHECKS
from .solver_checks import SOLVER_CHECKS

CHECKS: dict[str, tuple[Check[Any], ...]] = {"solver": SOLVER_CHECKS, "problem": PROBLEM_CHECKS}
"""All tests of a subject by its kind."""


@dataclass
class CheckingTask:
    """The task of the child: it runs one check at a time."""

    _before: ProcessState | None = None

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer the request "check" (kind and name of the subject, name of the check).

        Raises:
            MisbehaviourError: if the judge, or another part of the framework, was replaced, which invalidates all
                further checks.
        """
        self._before = self._before or ProcessState.now()
        answer = _run_check(*arguments)
        if fault := replacement_text(self._before):
            raise MisbehaviourError(fault)
        return answer, b""


def _run_check(kind: str, name: str, check_name: str) -> dict[str, str]:
    """Run one check; return its result, "passed", "failed" or "not applicable", and its sentence."""
    try:
        subject = create(name) if kind == "solver" else partial(load, name)
        next(check for check in CHECKS[kind] if check.name == check_name).run(subject)
    except NotApplicable as reason:
        return {"result": "not applicable", "sentence": f"{reason}."}
    except (Violation, ProxbenchError) as error:
        return {"result": "failed", "sentence": str(error)}
    except MemoryError:
        raise
    except BaseException as error:
        return {"result": "failed", "sentence": f"it raised {first_line(error)}{raised_at(error)}."}
    return {"result": "passed", "sentence": ""}
