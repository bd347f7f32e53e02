"""A rerun viewer without a window, which draws pictures of a recording at chosen times."""

import io
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
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from PIL import Image
from rerun.experimental import Timeline, ViewerClient

from ...problems.errors import error_text
from ..errors import BenchError
from .title_bars import TOP_BAR, Blueprint, clear_title_bars

PHASE_SECONDS = 60.0
"""Time limit of each phase of drawing: starting, loading, settling [s]."""

POLL_SECONDS = 0.5
"""Time between two checks of the viewer [s]."""

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class HeadlessViewer:
    """A viewer that shows one recording.

    Attributes:
        client: connection to the viewer.
        timeline: the timeline of the pictures, with its first and last time.
        blueprint: layout of the recording, as fields by archetype by entity.
    """

    client: ViewerClient
    timeline: Timeline
    blueprint: Blueprint

    @property
    def times(self) -> tuple[int, int]:
        """First and last time: a number of steps or iterations, or a time [ns]."""
        return self.timeline.start or 0, self.timeline.end or 0

    def show(self, blueprint: Mapping[str, Any], at: int) -> None:
        """Change the layout and the time, and wait until two successive pictures are equal."""
        self._seek(at)
        self.client.set_blueprint(dict(blueprint), "recording")
        latest = b""

        def is_settled() -> bool | None:
            nonlocal latest
            previous, latest = latest, self.client.take_screenshot()
            return True if latest == previous and _timeline(self.client, self.timeline.name) == self.timeline else None

        _wait_for(is_settled, "the picture does not settle")

    def picture(self, blueprint: Blueprint, at: int) -> Image.Image:
        """Return the picture at a time, in the layout that is shown, without the viewer's own buttons."""
        self._seek(at)
        with Image.open(io.BytesIO(self.client.take_screenshot())) as shot:
            content = shot.convert("RGB").crop((0, TOP_BAR, *shot.size))
        clear_title_bars(content, blueprint)
        return content

    def _seek(self, instant: int) -> None:
        """Stop at a time: a number of steps or iterations, or a time [ns]."""
        name = self.timeline.name
        if self.timeline.time_type == "sequence":
            self.client.set_time(name, sequence=instant, play_state="paused")
        else:
            self.client.set_time(name, duration=np.timedelta64(instant, "ns"), play_state="paused")


@contextmanager
def headless_viewer(recording: Path, timeline: str, size: tuple[int, int], target: Path) -> Iterator[HeadlessViewer]:
    """Yield a viewer of a recording, with all data loaded, for pictures of ``size`` [pixels]; then end it.

    Raises:
        BenchError: if the viewer is missing, or cannot draw the file ``target`` on this machine; the recording is kept.
    """
    search_path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    program = shutil.which("rerun", path=search_path)
    if program is None:
        raise BenchError(f"{recording} is kept, but the program rerun is missing; reinstall rerun-sdk.")
    try:
        with tempfile.TemporaryDirectory() as folder, _running_viewer(program, Path(folder), size) as client:
            client.open(str(recording.absolute()))
            loaded_timeline = _wait_for(lambda: _timeline(client, timeline), "loading takes too long")
            yield HeadlessViewer(client, loaded_timeline, client.get_blueprint("recording").blueprint)
    except Exception as error:  # any exception of the viewer and its experimental interface
        remedy = "install a Vulkan driver (on Debian: apt-get install mesa-vulkan-drivers)"
        if isinstance(error, TimeoutError):
            remedy = "repeat the command when the machine is less busy"
        raise BenchError(
            f"{recording} is kept, but the viewer cannot draw {target} here ({error_text(error)}); {remedy}."
        ) from error


def _timeline(client: ViewerClient, name: str) -> Timeline | None:
    """Return a timeline; None while data are being loaded."""
    state = client.get_state()
    if state.loading:
        return None
    return next(
        (timeline for recording in state.recordings for timeline in recording.timelines if timeline.name == name), None
    )


@contextmanager
def _running_viewer(program: str, folder: Path, size: tuple[int, int]) -> Iterator[ViewerClient]:
    """Yield the client of a new viewer without a window; then end the viewer."""
    port = _free_port()
    window = f"{size[0]}x{size[1] + TOP_BAR}"
    command = [program, "--headless", "--hide-welcome-screen", "--port", str(port), "--window-size", window]
    environment = {"RERUN_APP_ONLY": "true", "RUST_LOG": "error", "XDG_RUNTIME_DIR": str(folder)}
    with (folder / "messages").open("w+b") as messages:
        process = subprocess.Popen(
            command, env={**os.environ, **environment}, stdout=messages, stderr=messages, start_new_session=True
        )
        try:

            def connect() -> ViewerClient | None:
                if process.poll() is not None:
                    raise BenchError(f"the viewer exited with code {process.returncode}")
                with suppress(Exception):  # the viewer does not answer yet
                    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                    client.get_state()
                    return client
                return None

            yield _wait_for(connect, "it does not start")
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _wait_for(check: Callable[[], T | None], timeout_message: str) -> T:
    """Poll ``check`` until it returns a result other than None.

    Raises:
        TimeoutError: if ``check`` returns None for ``PHASE_SECONDS``, with the message ``timeout_message``.
    """
    deadline = time.monotonic() + PHASE_SECONDS
    while time.monotonic() < deadline:
        result = check()
        if result is not None:
            return result
        time.sleep(POLL_SECONDS)
    raise TimeoutError(timeout_message)


def _free_port() -> int:
    """Return a free TCP port of the local interface."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
