"""What is made of the result file of a simulation alone, whatever its step is: its table, its chart, its recording."""

import json
from pathlib import Path

from ..simulation.file import read_simulation
from ..variable.command import record_variable, show_variable
from ..variable.file import is_variable, read_variable
from .fixed import record_fixed, show_fixed


def report_simulation(file: Path, as_json: bool) -> int:
    """Print the table of a stored simulation, and draw its chart and recording again; return 1 if a step is unsolved.

    Raises:
        BenchError: if the file is missing, damaged or foreign.
        FailedSimulationError: if a step of it failed.
    """
    if is_variable(file):
        return show_variable(read_variable(file), as_json)
    return show_fixed(read_simulation(file), as_json)


def record_simulation(file: Path, output: Path | None, force: bool, as_json: bool) -> int:
    """Write the recording of a stored simulation, beside it if ``output`` is None; return 0.

    Raises:
        BenchError: if the file is missing, damaged or foreign, or the recording exists or cannot be written.
    """
    recording = file.with_suffix(".rrd") if output is None else output
    if is_variable(file):
        record_variable(read_variable(file), recording, force)
    else:
        record_fixed(read_simulation(file), recording, force)
    print(json.dumps({"file": str(recording)}, ensure_ascii=False) if as_json else f"watch it with: rerun {recording}")
    return 0
