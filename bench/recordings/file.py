"""A recording file: its path is checked before any work, and its data go to a temporary file, renamed at the end."""

import os
import uuid
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike

from ..errors import BenchError, UnwritableError
from ..store.store import check_links_inside

SUFFIX = ".rrd"
"""Suffix of recordings."""


class RecordingFile:
    """A recording that is being written; it is discarded if the ``with`` block fails or does not call ``begin``.

    Args:
        path: path of the recording; its folder is created if necessary.
        force: replace an existing file.

    Raises:
        BenchError: if the path exists (without ``force``), does not end in ``.rrd``, or cannot be written.
    """

    def __init__(self, path: Path, force: bool = False) -> None:
        self.path = path
        self._force = force
        self._stream: rr.RecordingStream | None = None
        check_recording_path(path, force)
        self._temporary = path.parent / f".{path.stem}-{uuid.uuid4().hex[:8]}.part"
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._temporary.touch(exist_ok=False)
        except OSError as error:
            raise UnwritableError(f"cannot write {path}: {error.strerror}; choose another folder.") from None

    def begin(self, kind: str, title: str, blueprint: rrb.Blueprint) -> rr.RecordingStream:
        """Open the stream and return it.

        Args:
            kind: "solve" or "simulation"; the viewer keeps the user's layout for each kind.
            title: name of the recording in the viewer.
            blueprint: initial layout of the viewer.
        """
        stream = rr.RecordingStream(f"proxbench {kind}")
        stream.save(self._temporary, default_blueprint=blueprint)
        stream.set_log_tick_enabled(False)
        stream.set_log_time_enabled(False)
        stream.send_recording_name(title)
        self._stream = stream
        return stream

    def __enter__(self) -> "RecordingFile":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if self._stream is not None:
                self._stream.flush()
                self._stream.disconnect()
            if kind is None and self._stream is not None:
                check_recording_path(self.path, self._force)
                os.replace(self._temporary, self.path)
        finally:
            self._temporary.unlink(missing_ok=True)


def write_curve(
    stream: rr.RecordingStream,
    entity: str,
    times: Sequence[rr.TimeColumn],
    values: ArrayLike,
    *,
    label: str,
    colour: tuple[int, int, int],
) -> None:
    """Write a curve to the recording: its style, and its values.

    Args:
        stream: the recording.
        entity: path of the curve in the viewer.
        times: times or step numbers, one column per timeline.
        values: values at these times, shape (n_times,).
        label: name in the legend.
        colour: red, green and blue, 0 to 255.
    """
    stream.log(entity, rr.SeriesLines(colors=[colour], names=[label], widths=[2.0]), static=True)
    stream.send_columns(entity, times, rr.Scalars.columns(scalars=values))


def check_recording_path(path: Path, force: bool) -> None:
    """Raise ``BenchError`` if a recording cannot be written to ``path``.

    The path must end in ``.rrd``. An existing file needs ``force``, and the path must not be a link that points
    outside its folder.
    """
    check_links_inside(path, path.parent)
    if path.suffix != SUFFIX:
        raise BenchError(f"cannot record into {path}: the name of a recording must end in {SUFFIX}.")
    if path.is_dir():
        raise BenchError(f"cannot record into {path}: it is a folder; name a file.")
    if path.exists() and not force:
        raise BenchError(f"{path} exists; choose another name, or replace it with `force=True`.")
