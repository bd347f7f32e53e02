"""A worker that is replaced by a fresh one when it has been crashed or kept too long."""

from types import TracebackType
from typing import Any, Self

from ...problems.arrays import FloatArray
from .worker import Fault, Task, Worker


class RenewedWorker:
    """One process after the other for one task; the first starts with the first request.

    Use it as a context manager, which ends the process.

    Attributes:
        seconds: wall time that each request may take [s].
    """

    def __init__(self, task: Task, seconds: float, memory_bytes: int) -> None:
        """Note what to start.

        Args:
            task: what the process does.
            seconds: wall time that each request may take [s].
            memory_bytes: memory it may take beyond what the framework itself needs.
        """
        self.seconds = seconds
        self._task, self._memory_bytes = task, memory_bytes
        self._worker: Worker | None = None

    def ask(self, request: str, *arguments: Any) -> tuple[dict[str, Any], FloatArray]:
        """Return the answer to one request, which has the whole time limit to itself.

        Raises:
            Fault: as ``Worker.ask`` does; the next request starts a fresh process.
        """
        if self._worker is None:
            self._worker = Worker(self._task, self.seconds, self._memory_bytes)
        self._worker.busy_seconds = 0.0
        try:
            return self._worker.ask(request, *arguments)
        except Fault:
            self._close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        if self._worker is not None:
            self._worker.close()
            self._worker = None
