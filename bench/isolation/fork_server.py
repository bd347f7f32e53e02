"""The server that supervisors and their cases are forked from: everything is loaded once, a case takes milliseconds.

It has no file, no address and no other client than the process that started it, and ends with it.
"""

import atexit
import contextlib
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from dataclasses import dataclass
from importlib import import_module

from .child import Assignment
from .pipe import is_readable, read_message, write_message
from .process_tree import send
from .supervisor import ENDING, NUMBER, keep

_FRAMEWORK = f"{__name__.partition('.')[0]}."

_REQUEST = b"F"
"""What a client sends with the open files of a request."""

_N_DESCRIPTORS = 3
"""Open files that every request brings: the case's pipe, its supervisor's orders, and the file for its output."""

_END_SECONDS = 5.0

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM", "RAYON")}
"""Environment that pins every numerical library to one thread."""

KEPT_MEMORY = {f"MALLOC_{name}_THRESHOLD_": str(2**30) for name in ("TRIM", "MMAP")}
"""Environment in which a process keeps what it frees, so that it does not get the same pages from the system again."""

START_SECONDS = 120.0
"""Wall time that a server may take to load everything, compile kernels that are in no cache yet, and fork [s]."""

_ATTEMPTS = 3


@dataclass
class SupervisorLink:
    """A supervisor as the run sees it.

    Attributes:
        pipe: where requests to its case go and answers come from.
        orders: for orders to it, and for its report of how the case ended.
        process: its process id.
        is_gone: whether it is known to have ended.
    """

    pipe: socket.socket
    orders: socket.socket
    process: int
    is_gone: bool = False
    _report: bytes = b""

    def send(self, order: bytes) -> None:
        """Give it an order, if it still lives."""
        with contextlib.suppress(OSError):
            self.orders.send(order)

    def ending(self, seconds: float) -> tuple[int | None, bool]:
        """Wait up to ``seconds`` until it has ended.

        Returns:
            The wait status of its case, None if it reported none, and whether a process of the case had nearly all its
            memory.
        """
        while not self.is_gone and is_readable(self.orders.fileno(), seconds):
            report = b""
            with contextlib.suppress(OSError):
                report = self.orders.recv(ENDING.size)
            self._report += report
            self.is_gone = not report
        return ENDING.unpack(self._report) if len(self._report) == ENDING.size else (None, False)

    def kill(self) -> None:
        """Kill it, if it has not gone by itself."""
        if not self.is_gone:
            send(signal.SIGKILL, [self.process])

    def close(self) -> None:
        """Close the connection to it."""
        self.pipe.close()
        self.orders.close()


class _Server:
    """The server as its client sees it."""

    def __init__(self) -> None:
        self.client = os.getpid()
        self._socket, theirs = socket.socketpair()
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve({theirs.fileno()})"
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                env={**os.environ, **ONE_THREAD, **KEPT_MEMORY},
                pass_fds=[theirs.fileno()],
                start_new_session=True,
            )

    def fork(self, content: bytes, output: int) -> SupervisorLink | None:
        """Let it fork a supervisor; return None if it does not, because it is gone or stuck."""
        pipe, case_pipe = socket.socketpair()
        orders, supervisor_orders = socket.socketpair()
        report = b""
        with case_pipe, supervisor_orders, contextlib.suppress(OSError):
            descriptors = [case_pipe.fileno(), supervisor_orders.fileno(), output]
            socket.send_fds(self._socket, [_REQUEST], descriptors)
            write_message(self._socket.fileno(), content)
        if is_readable(orders.fileno(), START_SECONDS):
            report = orders.recv(NUMBER.size)
        if len(report) == NUMBER.size:
            return SupervisorLink(pipe, orders, NUMBER.unpack(report)[0])
        pipe.close()
        orders.close()
        return None

    def end(self) -> None:
        """Let it end."""
        self._socket.close()
        if self.client == os.getpid():
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_SECONDS)
            self._process.kill()
            self._process.wait()


_server: _Server | None = None

_lock = threading.Lock()


def fork_supervisor(assignment: Assignment, output: int) -> SupervisorLink:
    """Start a supervisor with its case; the server is started, or started again, where there is none.

    Args:
        assignment: the case's.
        output: the open file for what the case prints.

    Raises:
        OSError: if no process can be started.
    """
    global _server
    content = pickle.dumps(assignment)
    with _lock:
        for _ in range(_ATTEMPTS):
            if _server is None or _server.client != os.getpid():
                _server = _Server()
            link = _server.fork(content, output)
            if link is not None:
                return link
            _server.end()
            _server = None
    raise OSError("the server that starts processes ends at once")


@atexit.register
def _end() -> None:
    if _server is not None:
        _server.end()


def serve(descriptor: int) -> None:
    """Be the server. Never returns."""
    from ...problems.compilation import silence_notice

    silence_notice()  # standard error belongs to the cases that are forked from here
    from . import preload  # noqa: F401

    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # supervisors report their end themselves
    requests = socket.socket(fileno=descriptor)
    while True:
        _, descriptors, _, _ = socket.recv_fds(requests, len(_REQUEST), _N_DESCRIPTORS)
        try:
            assignment: Assignment = pickle.loads(read_message(requests.fileno()))
        except EOFError:  # the client is gone
            os._exit(0)
        if assignment.module.startswith(_FRAMEWORK):
            import_module(assignment.module)  # once here, not in each case
        if os.fork() == 0:
            requests.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            pipe, orders, output = descriptors
            keep(pipe, orders, output, assignment)
        for received in descriptors:
            os.close(received)
