"""The process that watches over a case, and ends whatever the case has started.

    run ── fork server ── keeper ── case ── (what the plugin starts)

The keeper never runs a line of a plugin. It adopts what its descendants leave behind, in whatever session they hide,
and when the case ends, when the run says so or when the run itself is gone, it kills them all, removes the folder of
their temporary files, and ends as the case did. It also stops the case while others are measured, so that threads
and processes left running do not take the processor from them.
"""

import contextlib
import os
import resource
import shutil
import signal
import struct
from multiprocessing.connection import wait
from types import FrameType

from .child import Assignment, be_the_case
from .process_tree import adopt_orphans, descendants, kill_all, send

STOP, GO_ON, END = b"S", b"G", b"E"
"""What a keeper is told: stop the case, let it go on, end it. It also ends the case when nobody can tell any more."""

NUMBER = struct.Struct("!i")
"""What a keeper tells."""

_HEARD = (signal.SIGTERM, signal.SIGCHLD)
"""Signals that wake a keeper: the first ends its case, the second says that a child may have ended."""


def keep(pipe: int, orders: int, output: int, assignment: Assignment) -> None:
    """Fork the case's process, watch over it, and tell its end. Never returns.

    Args:
        pipe: the case's, for requests and answers.
        orders: where the keeper is told what to do, and tells first its process id, last the wait status of the case.
        output: where the case prints.
        assignment: the case's.
    """
    keeper = os.getpid()
    os.setsid()
    os.write(orders, NUMBER.pack(keeper))
    adopt_orphans()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):  # a case without temporary files may do
        assignment.folder.mkdir(0o700)
    woken = _listening()
    case = os.fork()
    if case == 0:
        _deafened(woken)
        os.close(orders)
        be_the_case(pipe, output, assignment, keeper)
    os.close(pipe)
    status = _watched(case, orders, woken[0])
    shutil.rmtree(assignment.folder, ignore_errors=True)
    with contextlib.suppress(OSError):
        os.write(orders, NUMBER.pack(status))
    os._exit(0)


def _listening() -> tuple[int, int]:
    """Return a pipe, (out, in), into which the system writes the number of every signal in ``_HEARD``."""
    woken = os.pipe()
    for end in woken:
        os.set_blocking(end, False)
    signal.set_wakeup_fd(woken[1], warn_on_full_buffer=False)
    for number in _HEARD:
        signal.signal(number, _heard)
    return woken


def _deafened(woken: tuple[int, int]) -> None:
    """Take back what ``_listening`` did."""
    signal.set_wakeup_fd(-1)
    for number in _HEARD:
        signal.signal(number, signal.SIG_DFL)
    for end in woken:
        os.close(end)


def _heard(number: int, frame: FrameType | None) -> None:
    """Do nothing: the number is in the pipe that wakes the keeper."""


def _watched(case: int, orders: int, woken: int) -> int:
    """Wait until the case has ended or shall end; end all that is left of it; return its wait status."""
    stopped: list[int] = []
    while True:
        ready = wait([orders, woken])
        if woken in ready and signal.SIGTERM in os.read(woken, 4096):
            return kill_all(case, signal.SIGKILL)
        if woken in ready and (status := _ended(case)) is not None:
            return kill_all(case, status)
        if orders not in ready:
            continue
        for order in _received(orders):
            if order == STOP[0]:
                stopped = [case, *descendants(case)]
                send(signal.SIGSTOP, stopped)
            elif order == GO_ON[0]:
                send(signal.SIGCONT, stopped)
            else:
                return kill_all(case, signal.SIGKILL)


def _received(orders: int) -> bytes:
    try:
        return os.read(orders, 4096) or END
    except OSError:
        return END


def _ended(case: int) -> int | None:
    """Take leave of all children that have ended; return the wait status of the case if it is among them."""
    status = None
    with contextlib.suppress(ChildProcessError):
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            status = ended[1] if ended[0] == case else status
    return status
