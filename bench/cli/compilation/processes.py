"""Processes that compile the parts of ``proxbench warm`` in parallel."""

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from itertools import cycle
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import NamedTuple, NoReturn

from ....problems.compilation.interpretation import compiled_kernels
from ....problems.compilation.notice import COMPILATION
from ...errors import BenchError
from ...isolation.fork_server import ONE_THREAD
from .shared_cache import share_cache

Part = Callable[[], None]
"""A function that calls kernels, so that numba compiles them."""


class Compiled(NamedTuple):
    """Number of compiled kernels, and compilation time [s]; with several processes, the longest time of one."""

    kernels: int
    seconds: float


def compile_here(parts: Sequence[Part]) -> Compiled:
    """Compile parts in this process."""
    kernels, seconds = COMPILATION.kernels, COMPILATION.seconds
    with compiled_kernels():
        for part in parts:
            part()
    return Compiled(COMPILATION.kernels - kernels, COMPILATION.seconds - seconds)


def compile_in_processes(parts: str, n_parts: int, n_processes: int) -> Compiled:
    """Compile parts in several processes; each takes its next part from one end of the list.

    Half of the processes use the other end, so that a process compiles neighbours in the list, which have kernels in
    common. The functions that numba generates for kernels are not cached; each process compiles its own.

    Args:
        parts: the function that returns the parts, as ``module:name``.
        n_parts: number of parts.
        n_processes: number of processes.

    Raises:
        BenchError: if a process fails; its standard error says why.
    """
    left = deque(range(n_parts))
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        numbers = range(n_processes)
        children = [stack.enter_context(_start(parts, folder, announces=number == 0)) for number in numbers]
        with ThreadPoolExecutor(n_processes) as threads:
            try:
                done = list(threads.map(_compile_in, children, cycle((left.popleft, left.pop))))
            finally:
                for child in children:
                    child.kill()
    return Compiled(sum(one.kernels for one in done), max(one.seconds for one in done))


def _start(parts: str, folder: str, announces: bool) -> "subprocess.Popen[str]":
    """Start a process; with ``announces``, it reports a long compilation, unless this process is silent."""
    serving = f"serve({parts!r}, {folder!r}, announces={announces and not COMPILATION.is_silent})"
    return subprocess.Popen(
        [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; {serving}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **ONE_THREAD},
        text=True,
        start_new_session=True,
    )


def _compile_in(child: "subprocess.Popen[str]", take: Callable[[], int]) -> Compiled:
    """Let a process compile parts until none is left and ``take`` raises IndexError."""
    assert child.stdin is not None
    assert child.stdout is not None
    kernels, seconds = 0, 0.0
    while True:
        try:
            part = take()
        except IndexError:
            return Compiled(kernels, seconds)
        with suppress(BrokenPipeError):
            print(part, file=child.stdin, flush=True)
        answer = child.stdout.readline()
        if not answer:
            raise BenchError("a process that compiles kernels has failed; its error is above.")
        compiled = Compiled(*json.loads(answer))
        kernels, seconds = kernels + compiled.kernels, seconds + compiled.seconds


def serve(parts: str, folder: str, announces: bool) -> NoReturn:
    """Compile the parts whose numbers standard input names, and answer each with its ``Compiled`` on standard output.

    This function never returns: the process ends when its standard input is closed.

    Args:
        parts: the function that returns the parts, as ``module:name``.
        folder: the folder of ``share_cache``.
        announces: whether to write the notice of a long compilation.
    """
    if not announces:
        COMPILATION.silence()
    release = share_cache(Path(folder))
    module, _, name = parts.partition(":")
    made: Sequence[Part] = getattr(importlib.import_module(module), name)()
    answers = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # parts may print
    numbers: SimpleQueue[int] = SimpleQueue()
    Thread(target=_read_numbers, args=(numbers,), daemon=True).start()
    while True:
        compiled = compile_here([made[numbers.get()]])
        release()
        os.write(answers, f"{json.dumps(compiled)}\n".encode())


def _read_numbers(numbers: SimpleQueue[int]) -> None:
    """Put the numbers from standard input into a queue; end this process when the input is closed."""
    for line in sys.stdin:
        numbers.put(int(line))
    os._exit(0)
