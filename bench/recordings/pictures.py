"""Pictures of a recording, drawn by the viewer without a screen: a still of the last frame, and a film."""

import io
from pathlib import Path

import numpy as np

from ..errors import BenchError
from ..report.layout.output_file import check_writable, write_file
from .headless import headless_viewer
from .title_bars import with_spatial_views_only, with_whole_curves, without_panels

STILL_SUFFIX, FILM_SUFFIX = ".png", ".webp"
"""Suffixes of the files of stills and films."""

STILL_SIZE, FILM_SIZE = (1600, 1000), (640, 560)
"""Width and height of stills and films [pixels]."""

FRAMES_PER_SECOND, LAST_FRAME_SECONDS = 20, 1.0
"""Frames per second of a film, and the time for which it shows the last frame [s]."""

WEBP_QUALITY = 70
"""Quality of the frames of a film, from 0 to 100."""


def check_picture_path(path: Path, suffix: str, force: bool) -> None:
    """Check that a still or film can be written at ``path``, without changing anything.

    Raises:
        BenchError: if ``path`` does not end in ``suffix``, cannot be written, or exists and ``force`` is False.
    """
    if path.suffix != suffix:
        raise BenchError(f"cannot draw {path}: its name must end in {suffix}.")
    check_writable([path], force)


def write_still(recording: Path, still: Path, timeline: str) -> None:
    """Draw the last frame of a recording, with complete curves, as a PNG picture.

    Args:
        recording: file, ending in ``.rrd``.
        still: file, ending in ``.png``; an existing file is replaced.
        timeline: name of the timeline whose last time is drawn.

    Raises:
        BenchError: if the viewer cannot draw on this machine, or the still cannot be written; the recording is kept.
    """
    content = io.BytesIO()
    with headless_viewer(recording, timeline, STILL_SIZE, still) as viewer:
        start, end = viewer.times
        layout = with_whole_curves(without_panels(viewer.blueprint), (start, end))
        after = 2 * end - start + 1  # beyond the end of the curves, plots show no time cursor
        viewer.show(layout, after)
        viewer.picture(layout, after).save(content, "PNG", optimize=True)
    write_file(still, content.getvalue())


def write_film(recording: Path, film: Path, timeline: str, n_frames: int) -> None:
    """Draw the spatial views of a recording at equal intervals as a WebP animation that repeats.

    Args:
        recording: file, ending in ``.rrd``.
        film: file, ending in ``.webp``; an existing file is replaced.
        timeline: name of the timeline over whose range the frames are distributed.
        n_frames: number of frames, at least 2.

    Raises:
        BenchError: if the viewer cannot draw on this machine, or the film cannot be written; the recording is kept.
    """
    content = io.BytesIO()
    with headless_viewer(recording, timeline, FILM_SIZE, film) as viewer:
        layout = with_spatial_views_only(without_panels(viewer.blueprint))
        times = np.linspace(*viewer.times, n_frames).round().astype(int).tolist()
        viewer.show(layout, times[0])
        first, *others = [viewer.picture(layout, at) for at in times]
    milliseconds = round(1000 / FRAMES_PER_SECOND)
    durations = [*[milliseconds] * (n_frames - 1), milliseconds + round(1000 * LAST_FRAME_SECONDS)]
    first.save(
        content, "WEBP", save_all=True, append_images=others, duration=durations, loop=0, quality=WEBP_QUALITY, method=4
    )
    write_file(film, content.getvalue())
