"""What is compiled during a step is no part of its time."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from numba import njit
from proxbench.bench.simulation import step_clock
from proxbench.bench.simulation.step_clock import WarmClock


class Stepper:
    """Takes steps of one kind: the third needs a kernel that is not compiled yet, the fourth a new one each time."""

    def __init__(self) -> None:
        self.system = SimpleNamespace(move=lambda position, velocity, duration: position)
        self.time_step, self.taken = 0.0, [0, 0, 0, 0]

    def step(self, state: Any) -> Any:
        self.taken[state.number] += 1
        if state.number == 2:
            self.kernel(1.0)
        if state.number == 3:
            njit(lambda x: x)(1.0)  # a kernel that is new each time
        return SimpleNamespace(contacts=None, state=state)

    @staticmethod
    @njit
    def kernel(x: float) -> float:
        return x + 1.0


def test_a_step_that_compiles_is_taken_again_once(monkeypatch: Any) -> None:
    stepper, clock = Stepper(), WarmClock()
    times = iter(range(100))
    monkeypatch.setattr(step_clock, "perf_counter", lambda: float(next(times)))
    for number in range(4):
        state = SimpleNamespace(number=number, keys=[], position=np.zeros(1), velocity=np.zeros(1))
        step, seconds = clock.step(stepper, state)  # type: ignore[arg-type]
        assert step.state.number == number
        assert seconds == 1.0
    assert stepper.taken == [2, 1, 2, 2]
