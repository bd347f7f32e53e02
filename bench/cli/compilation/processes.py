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
    """Number of compiled kernels, and compilation time [s]; with several processes, the longest time of any."""

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
    """Compile parts in several processes.

    Half of the processes take parts from the front of the list, the other half from the back. A process thus compiles
    mostly neighbouring parts, which have kernels in common. Numba does not cache the functions that it generates for
    kernels, so each process compiles its own.

    Args:
        parts: the function that returns the parts, as ``module:name``.
        n_parts: number of parts.
        n_processes: number of processes.

    Raises:
        BenchError: if a process fails; its standard error gives the reason.
    """
    remaining = deque(range(n_parts))
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        children = [stack.enter_context(_start(parts, folder, announces=i == 0)) for i in range(n_processes)]
        with ThreadPoolExecutor(n_processes) as threads:
            try:
                results = list(threads.map(_compile_in, children, cycle((remaining.popleft, remaining.pop))))
            finally:
                for child in children:
                    child.kill()
    return Compiled(sum(result.kernels for result in results), max(result.seconds for result in results))


def _start(parts: str, folder: str, announces: bool) -> "subprocess.Popen[str]":
    """Start a process that runs ``serve``; it announces nothing if this process is silent."""
    call = f"serve({parts!r}, {folder!r}, announces={announces and not COMPILATION.is_silent})"
    return subprocess.Popen(
        [sys.executable, "-c", f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; {call}"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **ONE_THREAD},
        text=True,
        start_new_session=True,
    )


def _compile_in(child: "subprocess.Popen[str]", take_number: Callable[[], int]) -> Compiled:
    """Let a process compile parts until ``take_number`` raises IndexError because none is left.

    Raises:
        BenchError: if the process ends.
    """
    assert child.stdin is not None
    assert child.stdout is not None
    kernels, seconds = 0, 0.0
    while True:
        try:
            number = take_number()
        except IndexError:
            return Compiled(kernels, seconds)
        with suppress(BrokenPipeError):
            print(number, file=child.stdin, flush=True)
        answer = child.stdout.readline()
        if not answer:
            raise BenchError("a process that compiles kernels has failed; its error is above.")
        compiled = Compiled(*json.loads(answer))
        kernels, seconds = kernels + compiled.kernels, seconds + compiled.seconds


def serve(parts: str, folder: str, announces: bool) -> NoReturn:
    """Compile the parts whose numbers arrive on standard input, and write a ``Compiled`` for each on standard output.

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
    all_parts: Sequence[Part] = getattr(importlib.import_module(module), name)()
    answers = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what parts print must not mix with the answers
    part_numbers: SimpleQueue[int] = SimpleQueue()
    Thread(target=_read_numbers, args=(part_numbers,), daemon=True).start()
    while True:
        compiled = compile_here([all_parts[part_numbers.get()]])
        release()
        os.write(answers, f"{json.dumps(compiled)}\n".encode())


def _read_numbers(part_numbers: SimpleQueue[int]) -> None:
    """Put the numbers from standard input into a queue; end this process when the input is closed."""
    for line in sys.stdin:
        part_numbers.put(int(line))
    os._exit(0)
