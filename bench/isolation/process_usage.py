"""Resource usage of this process: processor time, context switches and waiting time."""

from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from time import process_time
from typing import NamedTuple, Self

from ...problems.contact.solver import Solver
from ...solvers.native.executable import Executable


def used_processor_seconds(solver: Solver) -> float:
    """Return the processor time of this process, its terminated children and the program of an ``Executable`` [s]."""
    children = getrusage(RUSAGE_CHILDREN)
    program = solver.processor_seconds() if isinstance(solver, Executable) else 0.0
    return process_time() + children.ru_utime + children.ru_stime + program


class ContextSwitches(NamedTuple):
    """Context switches of this process, and the waiting time of the calling thread.

    Attributes:
        involuntary: number of times that the process was preempted.
        voluntary: number of times that the process gave up the processor to sleep or wait.
        waited: time for which the calling thread was ready but did not run [s]; None if the system does not report it.
    """

    involuntary: int
    voluntary: int
    waited: float | None

    @classmethod
    def now(cls) -> Self:
        """Return the current counts."""
        counts = getrusage(RUSAGE_SELF)
        try:  # the second number of schedstat is the waiting time [ns]
            waited = 1e-9 * float(Path("/proc/thread-self/schedstat").read_text().split()[1])
        except (OSError, ValueError, IndexError):
            waited = None
        return cls(counts.ru_nivcsw, counts.ru_nvcsw, waited)

    def since(self, before: Self) -> Self:
        """Return the differences from the counts ``before``."""
        waited = None if self.waited is None or before.waited is None else self.waited - before.waited
        return type(self)(self.involuntary - before.involuntary, self.voluntary - before.voluntary, waited)
