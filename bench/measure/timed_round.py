"""A round of timed solves from the process of a case, and whether other programs disturbed it.

A process loses time while another one runs on its core (it is *preempted*), while the hypervisor runs another machine,
or while it sleeps or waits for a device. Let T be the wall time of the solves, P their processor time, and w the time
for which the process can run but waits for the core [s]. Then

    lost = w                 if the process only switched voluntarily: it may have slept,
    lost = max(T - P, w)     otherwise: it never slept, or another process or thread took the core,

and the round is excluded if lost > TOLERATED_SHARE · T + TOLERATED_SECONDS. If the system does not measure w, it is 0.

Preemption of further threads of a solver is not detected: w is that of its main thread, and P may exceed T.

An adapter of an external solver also works outside its library, for example to judge answers. T includes that work, but
the time of a solve does not.

The first solve of a round has cold caches. Its time counts only if it is the only solve.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Self

import msgspec
import numpy as np
from msgspec import Meta, Struct

from ...problems.arrays import FloatArray
from ...problems.contact.solver import Status
from ...solvers.contract import MAX_ITERATIONS
from ..isolation.worker import Fault, invalid_answer_fault
from ..store.fields import MAX_NUMBER, Count
from ..store.outcome import Outcome
from ..store.records import Excluded, Round
from .points import quartiles

TOLERATED_SHARE = 0.02
"""Share of its wall time that a round may lose."""

TOLERATED_SECONDS = 5e-5
"""Additional time that a round may lose to system interrupts [s]."""

CLOCK_SECONDS = 5e-6
"""Processor time of a solve between reading one clock and reading the other [s]."""

PARALLEL_SECONDS = 1e-3
"""Processor time of each core by which a round may exceed its wall time [s]."""


Seconds = Annotated[float, Meta(ge=0.0, lt=MAX_NUMBER)]
"""A time [s]."""


class TimedRound(Struct, frozen=True):
    """Consecutive timed solves.

    Attributes:
        status: status of the last solve.
        iterations: iterations of the last solve, as the solver counts them.
        message: message of the last solve.
        prepare, solve, processor: wall times of preparing and solving, and processor time of both, for each solve [s].
        involuntary, voluntary: numbers of context switches during the solves.
        waited: time spent runnable but waiting for the core [s]; None if the system does not measure it.
        uncounted: wall time of each solve outside the library of an external solver [s]; empty if all of it counts.
        earlier_iterations: iterations of earlier solves of other problems; empty in rounds of one problem.
        answer_iterations: iterations of the first solve with each distinct answer, in the order of the answers; empty
            if only the answer of the last solve is returned.
        threads: number of threads of the last solve, if the prepared solver declares it.
    """

    status: Status
    iterations: Annotated[int, Meta(ge=0, le=MAX_ITERATIONS)]
    message: str
    prepare: Annotated[list[Seconds], Meta(min_length=1)]
    solve: list[Seconds]
    processor: list[Seconds]
    involuntary: Count
    voluntary: Count
    waited: Seconds | None
    uncounted: list[Seconds] = []
    earlier_iterations: list[Annotated[int, Meta(ge=0, le=MAX_ITERATIONS)]] = []
    answer_iterations: list[Annotated[int, Meta(ge=0, le=MAX_ITERATIONS)]] = []
    threads: Annotated[int, Meta(ge=1)] | None = None

    @classmethod
    def read(cls, answer: dict[str, Any], wall_seconds: float, is_built_in: bool = False) -> Self:
        """Convert an answer to a round.

        Args:
            answer: the answer.
            wall_seconds: wall time of the request, as measured outside the process [s].
            is_built_in: whether the solver is built in, so that no code of a plugin can write ``uncounted``.

        Raises:
            Fault: MISBEHAVED, if the answer is invalid.
        """
        try:
            timed = msgspec.convert(answer, cls)
        except msgspec.ValidationError:
            raise invalid_answer_fault() from None
        lengths = {len(timed.prepare), len(timed.solve), len(timed.processor), len(timed.uncounted or timed.prepare)}
        if timed.earlier_iterations:
            lengths.add(len(timed.earlier_iterations) + 1)
        if len(lengths) > 1 or (timed.uncounted and not is_built_in):
            raise invalid_answer_fault()
        counted = float(timed.walls.sum())
        if not counted <= wall_seconds:
            reason = f"the clock in its process counted {counted:g} s of solving in {wall_seconds:g} s of wall time"
            raise Fault(Outcome.MISBEHAVED, reason)
        return timed

    @property
    def totals(self) -> FloatArray:
        """Wall time of each solve, including preparation [s], shape (n,)."""
        return np.add(self.prepare, self.solve)

    @property
    def walls(self) -> FloatArray:
        """Wall time of each solve, including preparation and work outside the library [s], shape (n,)."""
        return np.add(self.totals, self.uncounted) if self.uncounted else self.totals

    @property
    def undisturbed_seconds(self) -> float:
        """Median of ``undisturbed`` [s], without the first solve, unless it is the only one."""
        return float(np.median(_warm(self.undisturbed)))

    @property
    def undisturbed(self) -> FloatArray:
        """Wall time of each solve, at most its processor time if the process was preempted [s], shape (n,)."""
        return np.minimum(self.totals, self.processor) if self.is_preempted else self.totals

    @property
    def n_readings(self) -> int:
        """Number of readings of both clocks."""
        return len(self.totals)

    @property
    def is_preempted(self) -> bool:
        """Whether the solves lost more time to other processes than a round may lose."""
        wall = float(self.walls.sum())
        missing, waited = wall - sum(self.processor), self.waited or 0.0
        may_have_slept = self.voluntary > 0 and self.involuntary == 0
        lost = waited if may_have_slept else max(missing, waited)
        return lost > TOLERATED_SHARE * wall + TOLERATED_SECONDS

    def threads_used(self, declared_threads: int) -> int:
        """Return the number of threads that the last solve used, at most the number that its solver declares."""
        return declared_threads if self.threads is None else min(self.threads, declared_threads)

    def exceeds(self, cores: int) -> bool:
        """Return whether the processor time of the solves exceeds that of ``cores`` fully used cores."""
        allowed = cores * (PARALLEL_SECONDS + CLOCK_SECONDS * self.n_readings)
        return sum(self.processor) - cores * (1.0 + TOLERATED_SHARE) * float(self.walls.sum()) > allowed

    def record(self, session: int, number: int, turn: int, probe: float, is_steady: bool) -> Round:
        """Return the record of the round.

        Args:
            session: number of the session of the run.
            number: number of the pass in the session.
            turn: number of the round in the pass.
            probe: the longer of the probes before and after the round [s].
            is_steady: whether both probes are close to the reference.
        """
        excluded: Excluded = "preempted" if self.is_preempted else "" if is_steady else "unsteady"
        return Round(
            session=session,
            number=number,
            turn=turn,
            prepare_seconds=float(np.median(_warm(self.prepare))),
            solve_seconds=float(np.median(_warm(self.solve))),
            total_seconds=quartiles(_warm(self.totals)),
            repeats=len(self.totals),
            wall_seconds=float(self.walls.sum()),
            processor_seconds=sum(self.processor),
            involuntary_switches=self.involuntary,
            voluntary_switches=self.voluntary,
            waited_seconds=self.waited,
            probe_seconds=probe,
            uncounted_seconds=float(sum(self.uncounted)),
            excluded=excluded,
        )


def _warm(seconds: Sequence[float] | FloatArray) -> FloatArray:
    """Return the times of all solves except the first, unless it is the only one."""
    return np.array(seconds[1:] if len(seconds) > 1 else seconds)
