"""Wall times of steps without compilation: numba compiles a kernel, or loads it, when it is first called."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from numba.core import event

from ...problems.motion.stepping.step import AcceptedStep

COMPILER_EVENT = "numba:compiler_lock"
"""Whatever compiles a kernel, or loads it from its cache, takes this lock of numba's."""


def without_compilation(steps: Iterator[AcceptedStep]) -> Iterator[AcceptedStep]:
    """Yield ``steps`` with wall times that leave out compilation.

    A stepper may try the next step before it yields one, so a compilation longer than its step is taken off the steps
    that follow.
    """
    compiling = 0.0
    while True:
        compiler: Any = event.TimingListener()  # type: ignore[no-untyped-call]
        with event.install_listener(COMPILER_EVENT, compiler):
            taken = next(steps, None)
        if taken is None:
            return
        compiling += compiler.duration if compiler.done else 0.0
        seconds = max(taken.seconds - compiling, 0.0)
        compiling -= taken.seconds - seconds
        yield replace(taken, seconds=seconds)
