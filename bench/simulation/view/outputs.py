"""The chart and the recording of a simulation: choose and check their files."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...report.layout.output_file import check_pictures_writable, check_writable, picture_files


@dataclass(frozen=True)
class SimulationOutputs:
    """Paths of the chart and the recording of a simulation.

    Attributes:
        chart: the chart, None if there is none.
        recording: the recording, None if there is none.
    """

    chart: Path | None = None
    recording: Path | None = None

    def document(self, result: Path) -> dict[str, str | None]:
        """Return the paths relative to the folder of the result, for ``read_outputs``."""
        folder = result.absolute().parent
        paths = {"chart": self.chart, "recording": self.recording}
        return {name: None if path is None else os.path.relpath(path, folder) for name, path in paths.items()}


def read_outputs(stored: Mapping[str, Any], result: Path) -> SimulationOutputs:
    """Return the outputs stored with ``result``, without paths outside its folder.

    A result from an untrusted source must not cause other files to be replaced.

    Raises:
        TypeError, KeyError: if ``stored`` is not a result of ``SimulationOutputs.document``.
    """
    return SimulationOutputs(_inside(stored["chart"], result), _inside(stored["recording"], result))


def _inside(stored: str | None, result: Path) -> Path | None:
    """Return a stored path; None if the path is outside the folder of the result."""
    if stored is None:
        return None
    folder = result.parent
    path = Path(os.path.normpath(folder / stored))
    return path if path.resolve().is_relative_to(folder.resolve()) else None


def choose_outputs(
    own: SimulationOutputs, chart: Path | None, recording: Path | None, force: bool
) -> SimulationOutputs:
    """Return the paths of chart and recording: the requested ones, or else the present ones.

    Args:
        own: present outputs of the simulation, which are always replaced.
        chart: the requested chart.
        recording: the requested recording.
        force: replace other existing files.

    Raises:
        BenchError: if a file cannot be written, or is another existing file and ``force`` is not given.
    """
    outputs = SimulationOutputs(chart or own.chart, recording or own.recording)
    if outputs.chart is not None:
        is_own_file = own.chart is not None and _picture(own.chart) == _picture(outputs.chart)
        check_pictures_writable(outputs.chart, force or is_own_file)
    if outputs.recording is not None:
        is_own_file = own.recording is not None and os.path.abspath(own.recording) == os.path.abspath(outputs.recording)
        from ...recordings.file import check_recording_path  # rerun takes a second to import

        check_recording_path(outputs.recording, force or is_own_file)
        check_writable([outputs.recording], force or is_own_file)
    return outputs


def _picture(path: Path) -> str:
    return os.path.abspath(picture_files(path)[0])
