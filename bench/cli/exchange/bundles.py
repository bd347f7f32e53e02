"""The commands ``proxbench bundle``, ``rejudge`` and ``merge``: runs as single files."""

from pathlib import Path
from typing import Annotated

import typer

from .. import options


def bundle(
    run_dir: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run.")],
    output: Annotated[
        Path | None, options.output(metavar="FILE", help="Bundle to write; RUN.bundle by default.")
    ] = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> None:
    """Pack a run into one file.

    The file contains the plan, machines, cases, impulses, and the problems that are not part of Proxbench.
    """
    from ...report.layout.text import print_json
    from ...runs import bundle as write_bundle

    file = write_bundle(run_dir, output, force=force)
    if as_json:
        print_json({"file": str(file), "bytes": file.stat().st_size})
    else:
        print(file if quiet else f"packed  {file} ({file.stat().st_size / 1024:.0f} KiB)")


def rejudge(
    file: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Bundle to check.")],
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> int:
    """Recompute the residuals of a bundle from its problems and impulses.

    No code in the bundle runs, and nothing is written. The exit code is 1 if a residual disagrees.
    """
    from msgspec import to_builtins

    from ...report.layout.text import print_json
    from ...runs import rejudge as rejudge_bundle
    from ..progress import ProgressBar

    with ProgressBar(not progress or quiet or as_json) as bar:
        verdict = rejudge_bundle(file, bar.count)
    if as_json:
        print_json({"file": str(file), **to_builtins(verdict)})
    else:
        for sentence in verdict.disagreements:
            print(sentence)
        if not quiet:
            print(verdict.sentence)
    return int(bool(verdict.disagreements))


def merge(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE", help="Bundles, and folders of runs.")],
    output: options.Runs = Path("results"),
    run_id: options.RunId = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
    progress: options.Progress = True,
) -> None:
    """Combine bundles and runs into one run.

    The residuals are recomputed first. All cases of a problem must come from one machine.
    """
    from ...report.layout.text import print_json
    from ...runs import merge as merge_runs
    from ..progress import ProgressBar

    missing: list[str] = []
    with ProgressBar(not progress or quiet or as_json) as bar:
        merged_run = merge_runs(sources, output, run_id, on_case=bar.count, on_missing=missing.append)
    options.print_notes(*missing)
    if as_json:
        print_json({"run": str(merged_run.folder), "is_finished": merged_run.is_finished, "missing": missing})
    else:
        print(merged_run.folder if quiet else merged_run)
