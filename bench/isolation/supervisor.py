"""The supervisor: a process that monitors a case and ends all processes that the case has started.

    run ── fork server ── supervisor ── case ── (what the plugin starts)

The supervisor never runs code of a plugin. It adopts orphaned descendants in any session. It kills all of them and
removes their temporary files when the case or the run ends, or when the run requests it. It also stops the case
while other cases are measured, so that remaining threads and processes do not use the processor.
"""

import contextlib
import os
import resource
import shutil
import signal
import struct
from multiprocessing.connection import wait
from types import FrameType

from .child import Assignment, peak_memory, run_case
from .process_tree import adopt_orphans, descendants, kill_all, send_signal

STOP, CONTINUE, END = b"S", b"C", b"E"
"""Orders: stop, continue or end the case. The case also ends when the connection is closed."""

PROCESS_ID = struct.Struct("!i")
"""Format of the first report, the process id of the supervisor."""

END_REPORT = struct.Struct("!i?")
"""Format of the last report: wait status of the case, and whether one of its processes used nearly all its memory."""

FULL_MEMORY_SHARE = 0.9
"""Share of the memory limit above which a case that ends without an answer counts as out of memory."""

_SIGNALS = (signal.SIGTERM, signal.SIGCHLD)
"""Signals that wake a supervisor: the first ends its case, the second reports that a child may have ended."""


def supervise(pipe: int, orders: int, output: int, assignment: Assignment) -> None:
    """Fork the process of the case, monitor it, and report its end. This function never returns.

    Args:
        pipe: descriptor for requests to the case and its answers.
        orders: descriptor for orders; the first report is the process id of the supervisor, the last is ``END_REPORT``.
        output: descriptor for the output of the case.
        assignment: task, memory limit and temporary folder of the case.
    """
    supervisor = os.getpid()
    os.setsid()
    try:
        os.write(orders, PROCESS_ID.pack(supervisor))
    except BrokenPipeError:  # the run no longer waits for this case
        os._exit(0)
    adopt_orphans()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):  # the case may need no temporary files
        assignment.folder.mkdir(0o700)
    wakeup = _signal_pipe()
    initial_memory, full_memory = peak_memory(resource.RUSAGE_SELF), FULL_MEMORY_SHARE * assignment.memory_bytes
    case = os.fork()
    if case == 0:
        _restore_signals(wakeup)
        os.close(orders)
        run_case(pipe, output, assignment, supervisor)
    os.close(pipe)
    status = _watch_case(case, orders, wakeup[0])
    shutil.rmtree(assignment.folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        os.write(orders, END_REPORT.pack(status, peak_memory(resource.RUSAGE_CHILDREN) >= initial_memory + full_memory))
    os._exit(0)


def _signal_pipe() -> tuple[int, int]:
    """Return a pipe (read end, write end) that receives the number of every signal in ``_SIGNALS``."""
    wakeup = os.pipe()
    for end in wakeup:
        os.set_blocking(end, False)
    signal.set_wakeup_fd(wakeup[1], warn_on_full_buffer=False)
    for number in _SIGNALS:
        signal.signal(number, _on_signal)
    return wakeup


def _restore_signals(wakeup: tuple[int, int]) -> None:
    """Undo ``_signal_pipe``."""
    signal.set_wakeup_fd(-1)
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    for end in wakeup:
        os.close(end)


def _on_signal(number: int, frame: FrameType | None) -> None:
    """Do nothing: the number is in the pipe that wakes the supervisor."""


def _watch_case(case: int, orders: int, wakeup: int) -> int:
    """Wait until the case has ended or must end, kill its remaining processes, and return its wait status."""
    stopped: list[int] = []
    while True:
        ready = wait([orders, wakeup])
        if wakeup in ready and signal.SIGTERM in os.read(wakeup, 4096):
            return kill_all(case, signal.SIGKILL)
        if wakeup in ready and (status := _reap_children(case)) is not None:
            return kill_all(case, status)
        if orders not in ready:
            continue
        for order in _read_orders(orders):
            if order == STOP[0]:
                stopped = [case, *descendants(case)]
                send_signal(signal.SIGSTOP, stopped)
            elif order == CONTINUE[0]:
                send_signal(signal.SIGCONT, stopped)
            else:
                return kill_all(case, signal.SIGKILL)


def _read_orders(orders: int) -> bytes:
    """Return the received orders, one byte each; ``END`` if the connection is closed."""
    with contextlib.suppress(OSError):
        return os.read(orders, 4096) or END
    return END


def _reap_children(case: int) -> int | None:
    """Reap all ended children; return the wait status of the case if it is among them."""
    status = None
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = ended[1] if ended[0] == case else status
    return status
