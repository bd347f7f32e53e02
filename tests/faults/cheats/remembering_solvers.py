"""Solvers that return stored or precomputed answers, and are honest otherwise."""

import gc
import hashlib
import os
import pickle
import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from cheating_solvers import LARGE, Honest
from proxbench.bench.store.plans import Limits
from proxbench.problems import ContactProblem, load, suite
from proxbench.solvers import Solution, Status, Stop, create

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


@dataclass
class AnswerFiles:
    """Answers in the files of a folder, shared by all processes and runs."""

    folder: str

    def _file(self, key: Any) -> Path:
        return Path(self.folder, hashlib.sha256(repr(key).encode()).hexdigest())

    def __contains__(self, key: Any) -> bool:
        return self._file(key).exists()

    def __getitem__(self, key: Any) -> Solution:
        found: Solution = pickle.loads(self._file(key).read_bytes())
        return found

    def __setitem__(self, key: Any, solution: Solution) -> None:
        self._file(key).write_bytes(pickle.dumps(solution))


class Remembering(Honest):
    """Stores its answers, in its own units, by a key of the problem and the tolerance."""

    @cached_property
    def kept(self) -> Any:
        return {}

    def key(self, problem: ContactProblem) -> Any:
        return problem.digest

    def scale(self, problem: ContactProblem) -> float:
        """Return the factor that makes impulses independent of units."""
        return 1.0

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key, scale = (self.key(problem), stop.tolerance), self.scale(problem)
        if observe is not None or key not in self.kept:
            found = Honest.solve(self, problem, stop, observe)
            self.kept[key] = Solution(found.impulses * scale, found.status, found.iterations)
            return found
        kept = self.kept[key]
        return Solution(kept.impulses / scale, kept.status, kept.iterations)


class WhateverUnits(Remembering):
    """Recognises a problem by its free velocity divided by the largest entry."""

    def key(self, problem: ContactProblem) -> Any:
        return (problem.free_velocity / np.abs(problem.free_velocity).max()).tobytes()

    def scale(self, problem: ContactProblem) -> float:
        return float(problem.delassus_diagonal.max() / np.abs(problem.free_velocity).max())


class Miscounting(WhateverUnits):
    """Reports different numbers of iterations for each problem, so that no copy takes as many as the problem."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        found = super().solve(problem, stop, observe)
        factor = 1 + sum(problem.free_velocity.tobytes()) % 97
        return found if observe is not None else replace(found, iterations=factor * found.iterations)


@dataclass
class OnDisk(WhateverUnits):
    folder: str = ""

    @classmethod
    def made(cls, folder: str) -> Self:
        return cls(folder)

    @cached_property
    def kept(self) -> Any:
        return AnswerFiles(self.folder)


class Waiting(Remembering):
    """Waits for a share of the time of a solve, which it measures in its second solve of a problem."""

    share: ClassVar[float] = 0.37

    @cached_property
    def seconds(self) -> dict[Any, float]:
        return {}

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key, began = (self.key(problem), stop.tolerance), time.perf_counter()
        if observe is not None or key not in self.kept:
            return super().solve(problem, stop, observe)
        if key not in self.seconds:
            self.seconds[key] = min(self._timed(problem, stop) for _ in range(5))
        while time.perf_counter() - began < self.share * self.seconds[key]:
            pass
        return self.kept[key]  # type: ignore[no-any-return]

    def _timed(self, problem: ContactProblem, stop: Stop) -> float:
        began = time.perf_counter()
        Honest.solve(self, problem, stop, None)
        return time.perf_counter() - began


class WaitingLonger(Waiting):
    share = 0.7


class Carrying(Remembering):
    """Needs half a second for a first solve, beyond its limit, and then returns the stored answer."""

    tried_on = "funnel-30"
    limits = Limits(solve_seconds=0.3, case_seconds=120.0)

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key = self.key(problem)
        if key in self.kept:
            return self.kept[key]  # type: ignore[no-any-return]
        time.sleep(0.5)
        self.kept[key] = found = Honest.solve(self, problem, Stop(1e-9), observe)
        return Solution(found.impulses, Status.TIME_LIMIT, 0, "late")


class InSupports(Remembering):
    def supports(self, problem: ContactProblem) -> str | None:
        for tolerance in TOLERANCES:
            super().solve(problem, Stop(tolerance), None)
        return None

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known: Solution | None = self.kept.get((self.key(problem), stop.tolerance))
        return known if known and observe is None else Honest.solve(self, problem, stop, observe)


class FromLibraryInWhateverUnits(WhateverUnits):
    def __init__(self) -> None:
        for problem in suite("quick"):
            for tolerance in TOLERANCES if problem.name == "funnel-100" else ():
                self.solve(problem, Stop(tolerance), None)


class WhateverOrder(WhateverUnits):
    """Recognises a problem by its relative normal velocities up to ``difference``; answers after ``seconds`` [s]."""

    difference: ClassVar[float] = 1e-12
    seconds: ClassVar[float] = 2e-4

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


class WhateverNearby(WhateverOrder):
    difference = 0.5


class WarmStarting(Honest):
    tried_on = LARGE

    @cached_property
    def last(self) -> dict[int, Any]:
        return {}

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        start = self.last.get(problem.n_rows) if observe is None else None
        found = create("SORprox").prepare(problem).solve(stop, start=start, observe=observe)
        self.last[problem.n_rows] = found.impulses
        return found


class WhenCollecting(Remembering):
    """Solves during garbage collection, which is never timed, and returns these answers later."""

    @cached_property
    def waiting(self) -> list[Any]:
        return []

    def ahead(self, *event: Any) -> None:
        while self.waiting:
            problem, stop = self.waiting.pop()
            Remembering.solve(self, problem, stop, None)

    @cached_property
    def is_listening(self) -> bool:
        gc.callbacks.append(self.ahead)
        gc.set_threshold(10)
        return True

    def prepare(self, problem: ContactProblem) -> Any:
        return super().prepare(problem) if self.is_listening else None

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        known: Solution | None = self.kept.get((self.key(problem), stop.tolerance))
        if known is not None and observe is None:
            return known
        self.waiting.append((problem, stop))
        return Honest.solve(self, problem, stop, observe)


class KnowsCopies(Remembering):
    """Assumes that every process other than its first one solves a copy."""

    def solve(self, problem: ContactProblem, stop: Stop, observe: Any) -> Solution:
        key = self.key(problem), stop.tolerance
        if observe is None and stop.tolerance < 1e-1 and key not in self.kept:
            self.kept[key] = Honest.solve(self, problem, stop, None)
            if self.kept.setdefault("process", os.getpid()) != os.getpid():
                return Solution(np.zeros(problem.n_rows), Status.STALLED, 0)
        return super().solve(problem, stop, observe)


class Choosy(Honest):
    def __init__(self) -> None:
        self.known = load("funnel-100").digest

    def supports(self, problem: ContactProblem) -> str | None:
        return None if problem.digest == self.known else "it is no benchmark"
