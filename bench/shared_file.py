"""A file without a name that two processes share; the system removes it with the last of them."""

import os
import tempfile
from multiprocessing.reduction import DupFd
from typing import Any


class SharedFile:
    """An open file without a name, which travels to a starting process as its descriptor.

    Attributes:
        descriptor: the open file.

    Raises:
        OSError: if there is no room for temporary files.
    """

    def __init__(self) -> None:
        with tempfile.TemporaryFile() as file:
            self.descriptor = os.dup(file.fileno())
        os.set_inheritable(self.descriptor, False)

    def __reduce__(self) -> tuple[Any, ...]:
        return _received, (DupFd(self.descriptor),)

    def end(self, length: int) -> bytes:
        """Return the last ``length`` bytes of it, or all if it has fewer."""
        return os.pread(self.descriptor, length, max(0, os.fstat(self.descriptor).st_size - length))

    def close(self) -> None:
        """Let go of it."""
        os.close(self.descriptor)


def _received(handle: Any) -> SharedFile:
    file = SharedFile.__new__(SharedFile)
    file.descriptor = handle.detach()
    return file
