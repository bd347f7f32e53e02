"""The fork server of supervisors and cases: it loads libraries once, so that a case starts within milliseconds.

It listens on no socket file and no network address. Its only client is the process that started it, and it ends with
that process.
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

from ...problems.compilation.cached_kernels import load_cached_kernels
from ...problems.compilation.notice import COMPILATION
from .child import Assignment
from .pipe import is_readable, read_message, write_message
from .process_tree import send_signal
from .supervisor import END_REPORT, PROCESS_ID, supervise

_FRAMEWORK = f"{__name__.partition('.')[0]}."

_REQUEST = b"F"
"""Message with which a client sends the open files of a request."""

_LOAD_KERNELS = b"K"
"""Message that requests the loading of all cached kernels; the server sends it back when they are loaded."""

_N_DESCRIPTORS = 3
"""Number of open files in a request: the pipe of the case, the socket for orders, and the output file."""

_END_SECONDS = 5.0
"""Time for the server to end before it is killed [s]."""

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB_MAXIMUM", "RAYON")}
"""Environment that limits every numerical library to one thread."""

KEPT_MEMORY = {f"MALLOC_{name}_THRESHOLD_": str(2**30) for name in ("TRIM", "MMAP")}
"""Environment in which a process keeps freed memory and need not request the same pages again."""

START_SECONDS = 900.0
"""Wall time limit for loading libraries, compiling kernels that are not cached, and forking [s].

Compilation takes minutes on a slow core. If a server ends, its client stops waiting at once.
"""

_MAX_ATTEMPTS = 3
"""Largest number of servers that are started for one supervisor."""


@dataclass
class SupervisorLink:
    """The connection of the run to a supervisor.

    Attributes:
        pipe: socket for requests to the case and its answers.
        orders: socket for orders, and for the report about the end of the case.
        process: process id of the supervisor.
        is_gone: whether the supervisor is known to have ended.
    """

    pipe: socket.socket
    orders: socket.socket
    process: int
    is_gone: bool = False
    _report: bytes = b""

    def send(self, order: bytes) -> None:
        """Send an order, if the supervisor is alive."""
        with contextlib.suppress(OSError):
            self.orders.send(order)

    def wait_for_end(self, seconds: float) -> tuple[int | None, bool]:
        """Wait up to ``seconds`` until the supervisor has ended.

        Returns:
            The wait status of its case (None if it reported none), and whether a process of the case used nearly all
            its memory.
        """
        while not self.is_gone and is_readable(self.orders.fileno(), seconds):
            report = b""
            with contextlib.suppress(OSError):
                report = self.orders.recv(END_REPORT.size)
            self._report += report
            self.is_gone = not report
        return END_REPORT.unpack(self._report) if len(self._report) == END_REPORT.size else (None, False)

    def kill(self) -> None:
        """Kill the supervisor, unless it has ended."""
        if not self.is_gone:
            send_signal(signal.SIGKILL, [self.process])

    def close(self) -> None:
        """Close the connection."""
        self.pipe.close()
        self.orders.close()


class _ServerClient:
    """The connection of a process to its fork server.

    Attributes:
        owner: id of the process that started the server.
    """

    def __init__(self) -> None:
        self.owner = os.getpid()
        self._socket, server_socket = socket.socketpair()
        call = f"serve({server_socket.fileno()}, announces={not COMPILATION.is_silent})"
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; {call}"
        with server_socket:
            self._process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                env={**os.environ, **ONE_THREAD, **KEPT_MEMORY},
                pass_fds=[server_socket.fileno()],
                start_new_session=True,
            )

    def fork(self, content: bytes, output: int) -> SupervisorLink | None:
        """Fork a supervisor; return None if the server has ended or does not answer.

        Args:
            content: the pickled assignment of the case.
            output: file descriptor for the output of the case.
        """
        pipe, case_pipe = socket.socketpair()
        orders, supervisor_orders = socket.socketpair()
        report = b""
        with case_pipe, supervisor_orders, contextlib.suppress(OSError):
            descriptors = [case_pipe.fileno(), supervisor_orders.fileno(), output]
            socket.send_fds(self._socket, [_REQUEST], descriptors)
            write_message(self._socket.fileno(), content)
        if is_readable(orders.fileno(), START_SECONDS):
            report = orders.recv(PROCESS_ID.size)
        if len(report) == PROCESS_ID.size:
            return SupervisorLink(pipe, orders, PROCESS_ID.unpack(report)[0])
        pipe.close()
        orders.close()
        return None

    def load_kernels(self) -> None:
        """Make the server load all cached kernels; wait for it for at most ``START_SECONDS``, unless it ends."""
        with contextlib.suppress(OSError):
            self._socket.send(_LOAD_KERNELS)
            if is_readable(self._socket.fileno(), START_SECONDS):
                self._socket.recv(len(_LOAD_KERNELS))

    def end(self) -> None:
        """End the server."""
        self._socket.close()
        if self.owner == os.getpid():
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_SECONDS)
            self._process.kill()
            self._process.wait()


_server: _ServerClient | None = None

_lock = threading.Lock()
"""Lock for the server and its socket."""


def fork_supervisor(assignment: Assignment, output: int) -> SupervisorLink:
    """Start a supervisor with its case, and the server if it is not running.

    Args:
        assignment: the assignment of the case.
        output: file descriptor for the output of the case.

    Raises:
        OSError: if no process can be started.
    """
    global _server
    content = pickle.dumps(assignment)
    with _lock:
        for _ in range(_MAX_ATTEMPTS):
            if _server is None or _server.owner != os.getpid():
                _server = _ServerClient()
            link = _server.fork(content, output)
            if link is not None:
                return link
            _server.end()
            _server = None
    raise OSError(f"the fork server ended {_MAX_ATTEMPTS} times before it started a process; see standard error")


def load_kernels() -> None:
    """Load all cached kernels in the server, if it is running, so that later cases have them in memory."""
    with _lock:
        if _server is not None and _server.owner == os.getpid():
            _server.load_kernels()


@atexit.register
def _end() -> None:
    """End the server when this process exits."""
    if _server is not None:
        _server.end()


def serve(descriptor: int, announces: bool) -> None:
    """Run the server. This function never returns.

    Args:
        descriptor: file descriptor of the socket to the client.
        announces: whether to write the notice of a long compilation, once for the server and all cases.
    """
    if not announces:
        COMPILATION.silence()
    COMPILATION.share_with_forks()
    from .preload import load_kernels_of
    from .process_state import exempt_from_collection

    exempt_from_collection()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # supervisors report the end of their cases themselves
    requests = socket.socket(fileno=descriptor)
    while True:
        request, descriptors, _, _ = socket.recv_fds(requests, len(_REQUEST), _N_DESCRIPTORS)
        if request == _LOAD_KERNELS:
            load_cached_kernels()
            exempt_from_collection()
            requests.send(_LOAD_KERNELS)
            continue
        try:
            assignment: Assignment = pickle.loads(read_message(requests.fileno()))
        except EOFError:  # the client has ended
            os._exit(0)
        if assignment.module.startswith(_FRAMEWORK):
            import_module(assignment.module)  # imported once here, not in each case
        load_kernels_of(assignment.solvers)
        if os.fork() == 0:
            requests.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            pipe, orders, output = descriptors
            supervise(pipe, orders, output, assignment)
        for received in descriptors:
            os.close(received)
