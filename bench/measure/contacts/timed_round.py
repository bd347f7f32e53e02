"""A round of timed solves as a case's process sends it, checked, and whether the core was its own meanwhile.

A process loses time while another one runs on its core (it is *preempted*), while the hypervisor runs another machine,
or while it sleeps or waits for a device. With T the wall seconds of the solves, P their processor seconds, and w the
seconds that the system counts as ready to run and not running,

    lost = w                 where the process switched voluntarily and never otherwise: it may have slept,
    lost = max(T - P, w)     elsewhere: it never slept, or something took the core, perhaps from another thread of it,

and the round is excluded if lost > TOLERATED_SHARE · T + TOLERATED_SECONDS. Where the system does not count w, it is 0.

The first solve of a round finds caches that other programs have used since the last round. Its time counts only where
there is no other.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from ....problems.arrays import FloatArray
from ....problems.contact.solver import Status
from ...isolation.worker import NO_ANSWER
from ...plugins.remote_solver import answer_fault
from ...store.records import Excluded, Round
from ..points import quartiles

TOLERATED_SHARE = 0.02
"""Share of its wall time that a round may lose."""

TOLERATED_SECONDS = 5e-5
"""What it may lose beyond that: the system's own interrupts [s]."""


CLOCK_SECONDS = 5e-6
"""Processor time of a solve that may pass between readings of both clocks [s]."""

PARALLEL_SECONDS = 1e-3
"""Processor time by which a round may exceed its wall time otherwise [s]."""


class NoRoundError(Exception):
    """What came is no round; the text says why."""


@dataclass(frozen=True)
class TimedRound:
    """Timed solves in one go.

    Attributes:
        status: how the last one ended.
        iterations: of the last one, as the solver counts them.
        message: of the last one.
        prepare, solve, processor: seconds of each solve [s], shape (n,).
        involuntary, voluntary: context switches meanwhile.
        waited: seconds of being ready to run and not running [s]; None where the system does not count them.
    """

    status: Status
    iterations: int
    message: str
    prepare: FloatArray
    solve: FloatArray
    processor: FloatArray
    involuntary: int
    voluntary: int
    waited: float | None

    @classmethod
    def read(cls, answer: dict[str, Any], wall_seconds: float) -> Self:
        """Return the round that an answer is, which took ``wall_seconds`` from outside [s].

        Raises:
            NoRoundError: if it cannot be one.
        """
        fault = answer_fault(answer)
        if fault:
            raise NoRoundError(fault)
        try:
            columns = [np.array(answer[name], dtype=np.float64) for name in ("prepare", "solve", "processor")]
            switches = [answer[name] for name in ("involuntary", "voluntary")]
            waited = None if answer["waited"] is None else float(answer["waited"])
        except (KeyError, TypeError, ValueError):
            raise NoRoundError(NO_ANSWER) from None
        shape = columns[0].shape
        are_columns = len(shape) == 1 and shape[0] and all(one.shape == shape for one in columns)
        numbers = np.concatenate([*columns, [0.0 if waited is None else waited]]) if are_columns else np.full(1, np.nan)
        if not (np.isfinite(numbers) & (numbers >= 0.0)).all() or not all(type(one) is int for one in switches):
            raise NoRoundError(NO_ANSWER)
        counted = float(columns[0].sum() + columns[1].sum())
        if counted > wall_seconds:
            raise NoRoundError(
                f"the clock in its process counted {counted:g} s of solving in {wall_seconds:g} s of wall time"
            )
        status, iterations, message = Status(answer["status"]), answer["iterations"], answer["message"]
        prepare, solve, processor = columns
        involuntary, voluntary = switches
        return cls(status, iterations, message, prepare, solve, processor, involuntary, voluntary, waited)

    @property
    def totals(self) -> FloatArray:
        """Wall seconds of each solve, preparing included [s], shape (n,)."""
        return self.prepare + self.solve

    @property
    def undisturbed_seconds(self) -> float:
        """Median wall seconds of a solve; where the process was preempted, processor seconds if they are fewer [s]."""
        return float(np.median(_warm(self.undisturbed)))

    @property
    def undisturbed(self) -> FloatArray:
        """The same of each solve [s], shape (n,)."""
        return np.minimum(self.totals, self.processor) if self.is_preempted else self.totals

    @property
    def is_preempted(self) -> bool:
        """Whether something else ran on its core for a part of its time that counts."""
        wall = float(self.totals.sum())
        missing, waited = wall - float(self.processor.sum()), self.waited or 0.0
        may_have_slept = self.voluntary > 0 and self.involuntary == 0
        lost = waited if may_have_slept else max(missing, waited)
        return lost > TOLERATED_SHARE * wall + TOLERATED_SECONDS

    @property
    def exceeds_one_core(self) -> bool:
        """Whether it worked longer than one core can in its wall time."""
        allowed = PARALLEL_SECONDS + CLOCK_SECONDS * len(self.totals)
        return float((self.processor - (1.0 + TOLERATED_SHARE) * self.totals).sum()) > allowed

    def record(self, session: int, number: int, turn: int, probe: float, is_steady: bool) -> Round:
        """Return the round as it is stored.

        Args:
            session: number of the session of the run.
            number: number of the pass in it.
            turn: number of the round in the pass.
            probe: the longer one of the probes before and after it [s].
            is_steady: whether they were about as long as others.
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
            wall_seconds=float(self.totals.sum()),
            processor_seconds=float(self.processor.sum()),
            involuntary_switches=self.involuntary,
            voluntary_switches=self.voluntary,
            waited_seconds=self.waited,
            probe_seconds=probe,
            excluded=excluded,
        )


def _warm(seconds: FloatArray) -> FloatArray:
    """Return the seconds of all solves but the first one; of that if it is alone."""
    return seconds[1:] if len(seconds) > 1 else seconds
