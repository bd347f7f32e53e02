"""The chart and the recording of a simulation: where they are, and that they can be written."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...report.layout.output_file import drawn, picture_files, refuse_pictures, refuse_taken


@dataclass(frozen=True)
class SimulationOutputs:
    """Where chart and recording of a simulation are.

    Attributes:
        chart: the chart, None if there is none.
        recording: the recording, None if there is none.
    """

    chart: Path | None = None
    recording: Path | None = None

    def document(self, result: Path) -> dict[str, str | None]:
        """Return the paths, seen from the folder of the result, from which ``read_outputs`` makes them again."""
        folder = result.absolute().parent
        paths = {"chart": self.chart, "recording": self.recording}
        return {name: None if path is None else os.path.relpath(path, folder) for name, path in paths.items()}


def read_outputs(stored: Mapping[str, Any], result: Path) -> SimulationOutputs:
    """Return what was stored with ``result``; paths that lead out of its folder are left out.

    A result may come from elsewhere: opening it must not replace files wherever it says.

    Raises:
        TypeError, KeyError: if it is no such document.
    """
    return SimulationOutputs(_inside(stored["chart"], result), _inside(stored["recording"], result))


def _inside(stored: str | None, result: Path) -> Path | None:
    """Return a stored path as seen from here, None if it leads out of the folder of the result."""
    if stored is None:
        return None
    folder = result.parent
    path = Path(os.path.normpath(folder / stored))
    return path if path.resolve().is_relative_to(folder.resolve()) else None


def choose_outputs(
    own: SimulationOutputs, chart: Path | None, recording: Path | None, force: bool
) -> SimulationOutputs:
    """Return where chart and recording will be: the requested places, or else the present ones.

    Args:
        own: those that the simulation has, which are replaced in any case.
        chart: the requested chart.
        recording: the requested recording.
        force: replace others.

    Raises:
        BenchError: if one cannot be written, or exists, is another one, and ``force`` is not given.
    """
    chosen = SimulationOutputs(chart or own.chart, recording or own.recording)
    if chosen.chart is not None:
        is_own = own.chart is not None and _picture(own.chart) == _picture(chosen.chart)
        refuse_pictures(chosen.chart, force or is_own)
    if chosen.recording is not None:
        is_own = own.recording is not None and os.path.abspath(own.recording) == os.path.abspath(chosen.recording)
        from ...recordings.file import refuse_bad_path  # rerun takes a second to import

        refuse_bad_path(chosen.recording, force or is_own)
        refuse_taken([chosen.recording], force or is_own)
    return chosen


def write_recording(record: Callable[[Path], None], recording: Path | None, result: Path) -> list[Path]:
    """Make the recording of ``result``, if it has one, and return its file.

    Raises:
        BenchError: if that fails for any reason, with the command that makes it later.
    """
    if recording is None:
        return []

    def made() -> list[Path]:
        record(recording)
        return [recording]

    return drawn(made, result, "recording", "make it with: proxbench record {}")


def _picture(path: Path) -> str:
    return os.path.abspath(picture_files(path)[0])
