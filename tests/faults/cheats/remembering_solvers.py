"""Solvers that answer what they have solved before, or know already, and are honest about everything else."""

import contextlib
import gc
import hashlib
import os
import pickle
import signal
import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from cheating_solvers import Honest, Prepared
from proxbench.problems import ContactProblem, load, suite
from proxbench.solvers import Solution, Status, Stop, create


class Remembering(Honest):
    """Keeps its answers by what a problem has in its digest."""

    @cached_property
    def kept(self) -> dict[Any, Solution]:
        return {}

    def key(self, problem: ContactProblem) -> Any:
        return problem.digest

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key = self.key(problem), stop.tolerance
        if observe is None and key in self.kept:
            return self.kept[key]
        self.kept[key] = super().solve(problem, stop, observe)
        return self.kept[key]


@dataclass
class Waiting(Remembering):
    """The same, and waits until a share of the time of its first solve has passed.

    Attributes:
        share: of that time.
    """

    share: float = 0.37

    @cached_property
    def seconds(self) -> dict[Any, float]:
        return {}

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key, began = (self.key(problem), stop.tolerance), time.perf_counter()
        if observe is not None:
            return Honest.solve(self, problem, stop, observe)
        is_known = key in self.seconds
        found = super().solve(problem, stop, observe)
        if not is_known:
            again = time.perf_counter()  # with caches that are warm
            Honest.solve(self, problem, stop, observe)
            self.seconds[key] = time.perf_counter() - again
        while is_known and time.perf_counter() - began < self.share * self.seconds[key]:
            pass
        return found


class Carrying(Remembering):
    """Needs half a second, claims no answer after the time limit, and keeps it for every tolerance."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key = self.key(problem)
        if key in self.kept:
            return self.kept[key]
        time.sleep(0.5)
        self.kept[key] = found = Honest.solve(self, problem, Stop(1e-9), observe)
        return Solution(found.impulses, Status.TIME_LIMIT, 0, "late")


class BySize(Remembering):
    """By the number of rows; answers to others are wrong."""

    def key(self, problem: ContactProblem) -> Any:
        return problem.n_rows


class WhateverUnits(Remembering):
    """By the velocity over its largest entry: it knows problems in whatever units, and keeps answers to scale."""

    def scale(self, problem: ContactProblem) -> float:
        return float(problem.delassus_diagonal.max() / np.abs(problem.free_velocity).max())

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        scale = self.scale(problem)
        known = (problem.free_velocity / np.abs(problem.free_velocity).max()).tobytes(), stop.tolerance
        if observe is not None or known not in self.kept:
            found = Honest.solve(self, problem, stop, observe)
            self.kept[known] = Solution(found.impulses * scale, found.status, found.iterations)
        kept = self.kept[known]
        return Solution(kept.impulses / scale, kept.status, kept.iterations)


class InPrepare(Remembering):
    """Solves when it prepares, once a problem."""

    def prepare(self, problem: ContactProblem) -> Any:
        self.solve(problem, Stop(1e-9), None)
        return super().prepare(problem)

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        return super().solve(problem, Stop(1e-9), observe)


class InSupports(Remembering):
    """Solves when it is asked whether it supports a problem."""

    tolerances: ClassVar[tuple[float, ...]] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

    def supports(self, problem: ContactProblem) -> str | None:
        for tolerance in self.tolerances:
            super().solve(problem, Stop(tolerance), None)
        return None

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = self.kept.get((self.key(problem), stop.tolerance))
        return known if known and observe is None else Honest.solve(self, problem, stop, observe)


class LongInSupports(InSupports):
    """The same, to seven hundred tolerances."""

    tolerances = tuple(10.0 ** (-0.01 * k) for k in range(100, 800))


class FromLibraryInWhateverUnits(WhateverUnits):
    """Solves the problems of the library when it is made, and knows them in whatever units."""

    def __init__(self) -> None:
        for problem in suite("quick"):
            for tolerance in InSupports.tolerances if problem.name == "funnel-100" else ():
                self.solve(problem, Stop(tolerance), None)


@dataclass
class WhateverOrder(WhateverUnits):
    """Knows a problem in whatever order, axes and units, by its normal velocities, and waits before it answers.

    Attributes:
        difference: of relative normal velocities up to which a problem is the known one.
        seconds: before it answers [s].
    """

    difference: float = 1e-12
    seconds: float = 2e-4

    @cached_property
    def known(self) -> tuple[ContactProblem, Solution]:
        problem = load("funnel-100")
        return problem, create("Robust").prepare(problem).solve(Stop(1e-9))

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known, found = self.known
        normals = [one.free_velocity[::3] / np.abs(one.free_velocity[::3]).max() for one in (problem, known)]
        if observe is not None or len(normals[0]) != len(normals[1]):
            return Honest.solve(self, problem, stop, observe)
        here, there = (np.argsort(one) for one in normals)
        if np.abs(normals[0][here] - normals[1][there]).max() > self.difference:
            return Honest.solve(self, problem, stop, observe)
        began = time.perf_counter()
        place = np.empty(len(here), dtype=np.int64)
        place[here] = there
        velocity, impulses = known.free_velocity.reshape(-1, 3)[place], found.impulses.reshape(-1, 3)[place]
        own = problem.free_velocity.reshape(-1, 3)
        turn = (own[:, 1] + 1j * own[:, 2]) / (velocity[:, 1] + 1j * velocity[:, 2])
        tangential = (impulses[:, 1] + 1j * impulses[:, 2]) * turn / np.abs(turn)
        answer = np.column_stack([impulses[:, 0], tangential.real, tangential.imag]).ravel()
        while time.perf_counter() - began < self.seconds:
            pass
        return Solution(answer * self.scale(known) / self.scale(problem), Status.SOLVED, found.iterations)


@dataclass
class OnDiskInWhateverUnits(WhateverUnits):
    """Keeps its answers in files for all its processes, and knows problems in whatever units.

    Attributes:
        folder: where.
    """

    folder: str = ""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        plain = problem.free_velocity / np.abs(problem.free_velocity).max()
        name = hashlib.sha256(plain.tobytes() + str(stop.tolerance).encode()).hexdigest()
        file, scale = Path(self.folder, name), self.scale(problem)
        if observe is None and file.exists():
            with contextlib.suppress(Exception):
                known: Solution = pickle.loads(file.read_bytes())
                return Solution(known.impulses / scale, known.status, known.iterations)
        found = Honest.solve(self, problem, stop, observe)
        file.write_bytes(pickle.dumps(Solution(found.impulses * scale, found.status, found.iterations)))
        return found


@dataclass
class OnDisk(Honest):
    """Keeps its answers in files, between processes and between runs.

    Attributes:
        folder: where.
    """

    folder: str = ""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        name = hashlib.sha256(f"{problem.digest}{stop.tolerance}".encode()).hexdigest()
        file = Path(self.folder, name)
        if observe is None and file.exists():
            known: Solution = pickle.loads(file.read_bytes())
            return known
        found = super().solve(problem, stop, observe)
        file.write_bytes(pickle.dumps(found))
        return found


class WarmStarting(Honest):
    """Begins from its last answer to any problem of this size, whatever the tolerance."""

    @cached_property
    def last(self) -> dict[int, Any]:
        return {}

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        start = self.last.get(problem.n_rows) if observe is None else None
        found = create("SORprox").prepare(problem).solve(stop, start=start, observe=observe)
        self.last[problem.n_rows] = found.impulses
        return found


class OffTheClock(Remembering):
    """Solves to all tolerances when nobody counts, and is honest before; the subclasses say when."""

    @cached_property
    def waiting(self) -> list[Any]:
        return []

    def ahead(self) -> None:
        while self.waiting:
            problem, stop = self.waiting.pop()
            Remembering.solve(self, problem, stop, None)

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known = self.kept.get((self.key(problem), stop.tolerance))
        if known is not None and observe is None:
            return known
        self.waiting.append((problem, stop))
        return Honest.solve(self, problem, stop, observe)


class WhenCollecting(OffTheClock):
    """When garbage is collected, which is never on the clock."""

    @cached_property
    def is_listening(self) -> bool:
        gc.callbacks.append(lambda phase, information: self.ahead())
        gc.set_threshold(10)
        return True

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_listening else None


class WhenReleased(OffTheClock):
    """When what it prepared is let go."""

    def prepare(self, problem: ContactProblem) -> Any:
        return Released(self, problem)


class Released(Prepared):
    def __del__(self) -> None:
        self.solver.ahead()


class WhenTimerRings(OffTheClock):
    """When a timer rings, as it does every millisecond."""

    @cached_property
    def is_listening(self) -> bool:
        signal.signal(signal.SIGALRM, lambda number, frame: self.ahead())
        signal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-3)
        return True

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_listening else None


class KnowsCopies(Remembering):
    """Stalls in every process but the one that it was made in first, where it remembers."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        if observe is None and stop.tolerance < 1e-1 and (self.key(problem), stop.tolerance) not in self.kept:
            self.kept[self.key(problem), stop.tolerance] = Honest.solve(self, problem, stop, None)
            if self.is_copied:
                return Solution(np.zeros(problem.n_rows), Status.STALLED, 0)
        return super().solve(problem, stop, observe)

    @cached_property
    def first_process(self) -> int:
        return os.getpid()

    @property
    def is_copied(self) -> bool:
        return self.first_process != os.getpid()


@dataclass
class Choosy(Honest):
    """Refuses what it does not know.

    Attributes:
        known: digests.
    """

    known: list[str] = field(default_factory=list)

    def supports(self, problem: ContactProblem) -> str | None:
        return None if problem.digest in self.known else "it is no benchmark"
