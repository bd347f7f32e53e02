"""Trees of processes: find, stop and kill all descendants of a process."""

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Iterable
from pathlib import Path

import psutil

_MAX_PASSES = 100
"""Largest number of passes that stop processes before they are killed; a running process may start others."""

_ALL_THREADS = 2
"""Low bits of a clock id that select the processor time of all threads of a process (clock_getcpuclockid(3))."""

_SET_DEATH_SIGNAL = 1
_SET_CHILD_SUBREAPER = 36
"""Options of ``prctl(2)``."""


def adopt_orphans() -> None:
    """Make this process the parent of orphaned descendants on Linux; elsewhere do nothing."""
    _prctl(_SET_CHILD_SUBREAPER, 1)


def end_with_parent(parent: int) -> None:
    """On Linux, make the system kill this process when its parent ends; exit if ``parent`` has already ended."""
    _prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def descendants(ancestor: int) -> list[int]:
    """Return the process ids of all descendants of ``ancestor``, parents before children."""
    all_descendants: list[int] = []
    pending = [ancestor]
    while pending:
        children = _children(pending.pop())
        all_descendants += children
        pending += children
    return all_descendants


def threads(process: int) -> list[int]:
    """Return the thread ids of a process; an empty list if it has ended."""
    try:
        return [thread.id for thread in psutil.Process(process).threads()]
    except psutil.Error:
        return []


def writers(descriptor: int) -> list[int]:
    """Return the ids of processes whose standard output or standard error is the open file of ``descriptor``.

    This process is left out. A process occurs twice if both streams are that file.
    """
    file, processes = os.fstat(descriptor), []
    for process in psutil.pids():
        for stream in (1, 2):
            with contextlib.suppress(OSError):
                if process != os.getpid() and os.path.samestat(os.stat(f"/proc/{process}/fd/{stream}"), file):
                    processes.append(process)
    return processes


def running(processes: Iterable[int]) -> list[int]:
    """Return those of ``processes`` that have not ended; zombies count as ended."""
    alive = []
    for process in processes:
        with contextlib.suppress(psutil.Error):
            if psutil.Process(process).status() != psutil.STATUS_ZOMBIE:
                alive.append(process)
    return alive


def processor_seconds(process: int) -> float:
    """Return the processor time of a process and of children that it waited for [s]; 0 if it has ended.

    On Linux, its own time is read from its processor-time clock; that of children has the resolution of system ticks.
    """
    try:
        times = psutil.Process(process).cpu_times()
    except psutil.Error:
        return 0.0
    own = times.user + times.system
    with contextlib.suppress(OSError):  # available only on Linux
        own = time.clock_gettime(~process << 3 | _ALL_THREADS)
    return float(own + times.children_user + times.children_system)


def describe_exit(status: int) -> str:
    """Return a clause that describes how a process ended, from its wait status."""
    if os.WIFEXITED(status):
        return f"its process ended with exit code {os.WEXITSTATUS(status)}"
    try:
        return f"its process was killed by {signal.Signals(os.WTERMSIG(status)).name}"
    except ValueError:
        return f"its process was killed by signal {os.WTERMSIG(status)}"


def send_signal(number: signal.Signals, processes: Iterable[int]) -> None:
    """Send a signal to those of ``processes`` that are alive."""
    for process in processes:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(process, number)


def kill_all(case: int, status: int) -> int:
    """Kill all descendants of this process, and wait until none is left.

    Args:
        case: process id of the case.
        status: the wait status to return if the case has already ended.

    Returns:
        The wait status of ``case``.
    """
    stopped: set[int] = set()
    for _ in range(_MAX_PASSES):  # stopped processes cannot start others
        unstopped = set(descendants(os.getpid())) - stopped
        if not unstopped:
            break
        send_signal(signal.SIGSTOP, unstopped)
        stopped |= unstopped
    while True:
        send_signal(signal.SIGKILL, descendants(os.getpid()))
        try:
            ended, ended_status = os.waitpid(-1, 0)
        except ChildProcessError:
            return status
        if ended == case:
            status = ended_status


def _children(process: int) -> list[int]:
    thread_folders = Path(f"/proc/{process}/task")
    try:
        return [
            int(child) for folder in thread_folders.iterdir() for child in (folder / "children").read_text().split()
        ]
    except OSError:
        pass
    with contextlib.suppress(psutil.Error):
        return [child.pid for child in psutil.Process(process).children()]
    return []


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)
