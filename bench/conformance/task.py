"""The child's half of ``proxbench check``: nothing of a plugin runs anywhere else."""

import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...problems.catalog.catalog import load, plugin_problems, problem_names
from ...problems.catalog.plugin_files import PluginFile, told
from ...problems.errors import ProxbenchError, suggestion
from ...solvers.registry import available, create, plugin_solvers
from ..errors import BenchError
from ..isolation.plugin_trial import try_import
from ..isolation.process_state import Surroundings
from ..measure.plugins import offers_of, use
from ..measure.protocol import MisbehaviourError
from .checks import NotApplicable, Violation
from .problem_checks import PROBLEM_CHECKS
from .solver_checks import SOLVER_CHECKS
from .surroundings_checks import replaced_names

_FRAMEWORK = tuple(Path(__file__).parents[2] / package for package in ("problems", "solvers", "bench"))


@dataclass
class CheckingTask:
    """Answers what there is to check, and runs one check at a time."""

    _before: Surroundings | None = None

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        """Answer "subjects" (of a plugin file or a name) or "check" (kind, name, name of the check).

        A mistake of the plugin that leaves nothing to check is answered as {"refused": sentence}.

        Raises:
            MisbehaviourError: if the judge, or anything else of the framework, is no longer what it was: what a check
                would say after that means nothing.
        """
        self._before = self._before or Surroundings.now()
        if request == "check":
            answer = _carried_out(*arguments)
            if fault := replaced_names(self._before):
                raise MisbehaviourError(fault)
            return answer, b""
        try:
            return {"subjects": _subjects(*arguments)}, b""
        except ProxbenchError as error:
            return {"refused": str(error)}, b""


def _subjects(target: PluginFile | str) -> list[dict[str, str]]:
    """Return kind, name and source of what ``target`` leads to.

    Raises:
        ProxbenchError: if it leads nowhere, or to a plugin that cannot be used.
    """
    if isinstance(target, PluginFile):
        try_import(target)
        use(target)
        return [{"kind": offer.kind, "name": offer.name, "source": offer.source} for offer in offers_of(target)]
    solvers = {offer.name: offer.source for offer in plugin_solvers()}
    problems = {offer.name: offer.source for offer in plugin_problems()}
    plain = target.partition("(")[0].strip()
    if plain in solvers or plain in available():
        return [{"kind": "solver", "name": create(target).name, "source": solvers.get(plain, "")}]
    known = problem_names()
    if target in problems or target in known:
        load(target)
        return [{"kind": "problem", "name": target, "source": problems.get(target, "")}]
    raise BenchError(f"there is no solver or problem {target!r}{suggestion(target, [*available(), *known])}")


def _carried_out(kind: str, name: str, check_name: str) -> dict[str, str]:
    """Run one check; return its result, "passed", "failed" or "not applicable", and the sentence to it."""
    try:
        if kind == "solver":
            next(check for check in SOLVER_CHECKS if check.name == check_name).run(create(name))
        else:
            next(check for check in PROBLEM_CHECKS if check.name == check_name).run(lambda: load(name))
    except NotApplicable as reason:
        return {"result": "not applicable", "sentence": f"{reason}."}
    except (Violation, ProxbenchError) as error:
        return {"result": "failed", "sentence": str(error)}
    except MemoryError:
        raise
    except BaseException as error:
        return {"result": "failed", "sentence": f"it raised {told(error)}{_place(error)}."}
    return {"result": "passed", "sentence": ""}


def _place(error: BaseException) -> str:
    """Return where an exception was raised, in the author's files rather than in a library's or in Proxbench's."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if "site-packages" not in frame.filename
        and not any(Path(frame.filename).is_relative_to(folder) for folder in _FRAMEWORK)
    ]
    return f" (line {frames[-1].lineno} of {Path(frames[-1].filename).name})" if frames else ""
