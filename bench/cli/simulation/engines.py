"""The command ``proxbench engines``: physics engines and Proxbench on the same scenes."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import options

if TYPE_CHECKING:
    from ...measure.trajectories.engines.measurement import Measurement


def engines(
    scenes: Annotated[
        list[str] | None, typer.Argument(metavar="SCENE", help="Like thrown-cube or pile; all by default.")
    ] = None,
    engine: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="mujoco, pybullet, rapier, dart or proxbench; repeatable, all by default."),
    ] = None,
    rounds: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER", min=1, help="Runs of each setting; default: those of --resume, or 1.", show_default=False
        ),
    ] = None,
    output: Annotated[
        Path | None, options.output(metavar="FILE", help="Result to write: tables (.md) or data (.json).")
    ] = None,
    resume: Annotated[
        Path | None,
        options.output(metavar="RESULT", help="Keep the runs of this .json file, and add the missing ones."),
    ] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Compare physics engines: wall time per simulated second against the error of the motion.

    Each run has its own process with one thread. Ctrl-C keeps the finished
    runs. The engines require the extra "engines".
    """
    import msgspec

    from ...errors import BenchError, InterruptedWorkError
    from ...measure.trajectories.engines.run import compare_engines, read_comparison
    from ...report.layout.output_file import check_writable, write_file
    from ...report.layout.text import counted, print_json
    from .engine_table import comparison_tables

    if quiet and output is None and resume is None:
        raise BenchError("--quiet does not print the tables; write them to a file with --output FILE.")
    if output is not None:
        _require_suffix(output)
        check_writable([output], force)
    on_run = _print_run if progress and not (quiet or as_json) else lambda run: None
    earlier = None if resume is None else read_comparison(resume)
    comparison = compare_engines(scenes or (), engine or (), rounds, on_run, earlier=earlier)
    text = comparison_tables(comparison)
    files = list(filter(None, (resume, output)))
    for file in files:
        writes_json = file.suffix == ".json" or file == resume
        write_file(file, msgspec.json.format(msgspec.json.encode(comparison)) if writes_json else text.encode())
    if as_json:
        print_json(msgspec.to_builtins(comparison))
    else:
        print(*(files if quiet else [text]), sep="\n")
    if comparison.is_interrupted:
        raise InterruptedWorkError(f"interrupted; {counted(len(comparison.measurements), 'setting')} measured.")
    return int(any(run.failure for run in comparison.measurements))


def _require_suffix(output: Path) -> None:
    from ...errors import BenchError

    if output.suffix not in (".md", ".json"):
        raise BenchError(f"--output {output} must end in .md (tables) or .json (data).")


def _print_run(run: "Measurement") -> None:
    result = run.failure or f"{1e3 * run.wall_seconds:.3g} ms per simulated second"
    print(f"{run.scene}: {run.engine}, {run.setting}: {result}", file=sys.stderr)
