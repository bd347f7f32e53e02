"""The command ``proxbench check``."""

from typing import Annotated

import typer

from .. import options


def check(
    target: Annotated[str, typer.Argument(metavar="NAME|FILE", help="Solver, problem, plugin file or problem file.")],
    check_seconds: Annotated[float, options.limits(metavar="SECONDS", help="Time limit of one check.")] = 60.0,
    plugin: options.PluginFiles = None,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Test a solver or problem for conformance.

    The exit code is 1 if a check fails.
    """
    from ...conformance.run import print_checks, run_checks
    from ...report.layout.text import print_json
    from ..progress import ProgressBar

    with ProgressBar(quiet or as_json) as progress:

        def show(check: str, done: int, total: int) -> None:
            progress.name(check, bar_only=True)
            progress.count(done, total)

        subjects = run_checks(target, check_seconds, show)
    if as_json:
        print_json(subjects)
    else:
        print_checks(subjects, failed_only=quiet)
    return int(not all(subject["passed"] for subject in subjects))
