"""Specifications from which other processes create solvers.

Built-in solvers are created in any process. Solvers of plugins and of the caller are created and examined in child
processes only, so that none of their code runs where results are judged.
"""

import sys
from dataclasses import dataclass, replace
from typing import Any

import cloudpickle

from ...problems.contact.model import Model
from ...problems.contact.solver import Solver, draws_randomly, shows_iterates, starts_from_last_answer, threads_of
from ...solvers import registry
from ...solvers.composite.warm import warm_name
from ...solvers.native.executable import Executable
from ..errors import BenchError
from ..store.records import PluginUse
from .native_files import check_unchanged


@dataclass(frozen=True)
class SolverSpec:
    """A solver with its options.

    Attributes:
        name: its name, with options.
        model: the model that it solves.
        has_iterates: whether its iterates can be observed.
        source: its plugin, for messages; empty for a built-in solver and for a solver object of the caller.
        pickled: the pickled solver object of the caller; empty if the name suffices to create the solver.
        is_randomised: whether the solver declares that its answers differ between repeats.
        threads: number of threads that it declares.
        files: the shared libraries and executables that it needs, with their digests.
        starts_warm: whether it starts from its own answer to the previous step.
    """

    name: str
    model: Model
    has_iterates: bool = True
    source: str = ""
    pickled: bytes = b""
    is_randomised: bool = False
    threads: int = 1
    files: tuple[PluginUse, ...] = ()
    starts_warm: bool = False

    @property
    def n_processes(self) -> int:
        """Number of processes that it keeps in addition to that of its case: one for each executable."""
        return sum(use.name.startswith(Executable.__name__) for use in self.files)

    @property
    def is_built_in(self) -> bool:
        """Whether it is a built-in solver."""
        return not self.source and not self.pickled

    @property
    def compiled_solvers(self) -> list[str]:
        """Built-in solvers whose kernels it uses; all of them if it is not built in, because it may use any."""
        return registry.compiled_solvers(self.name if self.is_built_in else None)

    def make(self) -> Solver:
        """Return the solver; in the judging process, call this only for built-in solvers.

        Raises:
            ProxbenchError: if the solver no longer exists, or one of its files has changed.
            Exception: any error of the caller's code.
        """
        check_unchanged(self.files)
        solver: Solver = cloudpickle.loads(self.pickled) if self.pickled else registry.create(self.name)
        return solver


def built_in(name: str) -> SolverSpec:
    """Return the specification of a built-in solver.

    Raises:
        SolverError: for an unknown option, or a value out of range.
    """
    solver = registry.create(name)
    return SolverSpec(
        solver.name,
        solver.model,
        shows_iterates(solver),
        is_randomised=draws_randomly(solver),
        threads=threads_of(solver),
        starts_warm=starts_from_last_answer(solver),
    )


def warm_variant(spec: SolverSpec) -> SolverSpec:
    """Return the specification of ``Warm(solver)``; a specification that already starts warm is returned as is."""
    return spec if spec.starts_warm else replace(spec, name=warm_name(spec.name), starts_warm=True)


def pickle_solver(solver: Any) -> bytes:
    """Pickle a solver object of the caller for the processes of its cases.

    If child processes cannot import the class (from a notebook, script, or standard input), the pickle includes it.

    Raises:
        BenchError: if the object or its class cannot be pickled.
    """
    module = sys.modules.get(type(solver).__module__)
    is_pickled_by_value = module is not None and module.__name__ != "__main__" and not _is_importable(module.__name__)
    try:
        if is_pickled_by_value:
            cloudpickle.register_pickle_by_value(module)
        return bytes(cloudpickle.dumps(solver))
    except Exception as error:
        fault = f"{type(error).__name__}: {error}"
        raise BenchError(
            f"the solver {type(solver).__name__} cannot be sent to the process of its cases ({fault:.200}); store "
            "plain options only, or provide its class in a plugin file."
        ) from None
    finally:
        if is_pickled_by_value:
            cloudpickle.unregister_pickle_by_value(module)


def _is_importable(name: str) -> bool:
    """Return whether a new process can import a module."""
    package = sys.modules.get(name.rpartition(".")[0])
    path = getattr(package, "__path__", None)
    try:
        return any(finder.find_spec(name, path) is not None for finder in sys.meta_path)
    except (ImportError, ValueError, AttributeError):
        return False
