"""A trial import of a plugin file, for the file whose import ends its process: no exception tells of that."""

import contextlib
import os
import signal

from ..problems.errors import PluginError
from ..problems.plugin_files import PluginFile, make_importable

_CAME_BACK = b"."


def try_import(file: PluginFile) -> None:
    """Import a plugin file in a forked process, in silence; what it raises there is left to the import that follows.

    Raises:
        PluginError: if the process does not come back from the import: os._exit, a crash in native code.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        _import_and_leave(file, writing)
    try:
        _, status = os.waitpid(child, 0)
        os.set_blocking(reading, False)  # a process that the plugin has left behind may hold the other end
        try:
            came_back = os.read(reading, 1) == _CAME_BACK
        except BlockingIOError:
            came_back = False
    finally:
        os.close(reading)
        os.close(writing)
    if not came_back:
        raise PluginError(f"{file.source} fails to import: {_ending(status)}; a plugin file must only define things.")


def _import_and_leave(file: PluginFile, writing: int) -> None:
    with contextlib.suppress(BaseException):
        silence = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silence, stream)
        make_importable(file)
        file.module()
    os.write(writing, _CAME_BACK)
    os._exit(0)


def _ending(status: int) -> str:
    if os.WIFEXITED(status):
        return f"it ends the process with exit code {os.WEXITSTATUS(status)}"
    number = os.WTERMSIG(status)
    known = {int(one): one.name for one in signal.Signals}
    return f"it ends the process with {known.get(number, f'signal {number}')}"
