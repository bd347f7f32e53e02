"""What is made of the result file of a simulation alone, whatever its step is: its table, its chart, its recording."""

import json
from dataclasses import replace
from pathlib import Path

from ..simulation.file import read_simulation
from ..variable.command import record_variable, show_variable
from ..variable.file import is_variable, read_variable
from ..variable.simulation import VariableSimulation
from .fixed import record_fixed, show_fixed


def report_simulation(file: Path, charts: bool, quiet: bool, as_json: bool) -> int:
    """Print the table of a stored simulation, and draw its chart and recording again; return 1 if a step is unsolved.

    Args:
        file: of the simulation.
        charts: draw the chart.
        quiet: print the places of the files alone.
        as_json: print one JSON document instead.

    Raises:
        BenchError: if the file is missing, damaged or foreign.
        FailedSimulationError: if a step of it failed.
    """
    simulation = read_variable(file) if is_variable(file) else read_simulation(file)
    if not charts:
        simulation.beside = replace(simulation.beside, chart=None)
    if isinstance(simulation, VariableSimulation):
        return show_variable(simulation, as_json, quiet)
    return show_fixed(simulation, as_json, quiet)


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
