"""Atomic writing of files."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

PART = ".part"
"""Suffix of a file that is being written; its name begins with a dot."""

PERMISSIONS = 0o666
"""Permissions of a new file before the mask of the process is applied."""


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file beside ``path`` that replaces it when the block ends, and is removed if the block fails.

    The new file has the usual permissions, not those of a temporary file.

    Raises:
        OSError: if the folder cannot be written.
    """
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=PART)
    try:
        with os.fdopen(handle, "wb") as file:
            mask = os.umask(0o077)  # reading the mask sets it; a strict one is safe if another thread creates a file
            os.umask(mask)
            os.chmod(temporary, PERMISSIONS & ~mask)
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
