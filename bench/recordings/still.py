"""Stills: the end of the timeline of a recording as a PNG, drawn by the viewer without a screen.

Each panel keeps its title bar with the viewer's three buttons, because a blueprint can only hide the whole bar
(``ViewBlueprint.titlebar``), and curves and solvers need their titles.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from rerun.experimental import ViewerClient

from ...problems.errors import error_text
from ..errors import BenchError
from ..report.layout.output_file import refuse_taken, write_file

SUFFIX = ".png"

SIZE = (1600, 1000)
"""Width and height of the picture [pixels]."""

SECONDS = 60.0
"""Time limit for each phase of drawing: starting, loading, settling [s]."""

PAUSE = 0.5
"""Time between two checks of the viewer [s]."""

PANELS = {
    "/top_panel": "PanelBlueprint",
    "/blueprint_panel": "PanelBlueprint",
    "/selection_panel": "PanelBlueprint",
    "/time_panel": "TimePanelBlueprint",
}
"""Entities of the viewer's own panels in a blueprint, with their archetypes."""

T = TypeVar("T")


def refuse_still(path: Path, force: bool) -> None:
    """Check that a still can be written at ``path``, without changing anything.

    Raises:
        BenchError: if it does not end in ``.png``, cannot be written, or exists and ``force`` is not given.
    """
    if path.suffix != SUFFIX:
        raise BenchError(f"cannot draw a still into {path}: its name must end in {SUFFIX}.")
    refuse_taken([path], force)


def write_still(recording: Path, still: Path, timeline: str) -> None:
    """Draw the end of a recording, when all data are loaded and two successive pictures are equal.

    Args:
        recording: file, ending in ``.rrd``.
        still: file, ending in ``.png``; an existing file is replaced.
        timeline: timeline whose last time is drawn.

    Raises:
        BenchError: if the viewer cannot draw on this machine, or the still cannot be written; the recording is kept.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            picture = _drawn(recording.absolute(), timeline, Path(folder))
        except Exception as error:  # any exception of the viewer and its experimental interface
            raise BenchError(
                f"{recording} is kept, but the viewer cannot draw {still} here ({error_text(error)}); it needs a "
                "Vulkan driver (on Debian: apt-get install mesa-vulkan-drivers)."
            ) from error
    write_file(still, picture)


def _drawn(recording: Path, timeline: str, folder: Path) -> bytes:
    shot = folder / "shot.png"
    with _viewer(folder) as client:
        client.open(str(recording))
        end = _waited(lambda: _end(client, timeline), "loading takes too long")
        client.set_time(timeline, sequence=end, play_state="paused")
        client.set_blueprint(without_panels(client.get_blueprint("recording").blueprint), "recording")
        before = b""

        def settled() -> bytes | None:
            nonlocal before
            client.save_screenshot(str(shot))
            last, before = before, shot.read_bytes()
            return before if before == last and _end(client, timeline) == end else None

        return _waited(settled, "the picture does not settle")


def without_panels(blueprint: Mapping[str, Any]) -> dict[str, Any]:
    """Return a blueprint without the viewer's own panels, whose buttons and badges do not belong to the recording.

    Args:
        blueprint: fields by archetype by entity, as in the viewer.
    """
    hidden = {
        panel: {archetype: {**blueprint.get(panel, {}).get(archetype, {}), "state": "Hidden"}}
        for panel, archetype in PANELS.items()
    }
    return {**blueprint, **hidden}


def _end(client: ViewerClient, timeline: str) -> int | None:
    """Return the last time of the timeline; None while data are being loaded."""
    state = client.get_state()
    if state.loading:
        return None
    ends = (line.end for held in state.recordings for line in held.timelines if line.name == timeline)
    return next(ends, None)


@contextmanager
def _viewer(folder: Path) -> Iterator[ViewerClient]:
    """Run a separate viewer without a window, and end it."""
    program = shutil.which(
        "rerun", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    )
    if program is None:
        raise BenchError("the program rerun is not installed")
    port = _free_port()
    width, height = SIZE
    line = [program, "--headless", "--hide-welcome-screen", "--port", str(port), "--window-size", f"{width}x{height}"]
    quiet = {"RERUN_APP_ONLY": "true", "RUST_LOG": "error", "XDG_RUNTIME_DIR": str(folder)}
    with (folder / "messages").open("w+b") as messages:
        process = subprocess.Popen(
            line, env={**os.environ, **quiet}, stdout=messages, stderr=messages, start_new_session=True
        )
        try:

            def answering() -> ViewerClient | None:
                if process.poll() is not None:
                    raise BenchError(f"it ended with {process.returncode}")
                with suppress(Exception):  # not yet
                    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                    client.get_state()
                    return client
                return None

            yield _waited(answering, "it does not start")
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _waited(look: Callable[[], T | None], late: str) -> T:
    """Poll until there is a result."""
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        found = look()
        if found is not None:
            return found
        time.sleep(PAUSE)
    raise BenchError(late)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
