"""``proxbench fclib info | import | export``: inspect, read and write FCLIB files."""

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from .. import options

if TYPE_CHECKING:
    from ....problems.exchange.fclib.survey import Survey

SUFFIX, PROBLEM_SUFFIX = ".hdf5", ".npz"

app = typer.Typer(
    help="Inspect, import and export FCLIB files (.hdf5), the exchange format of contact problems.",
    epilog=options.examples(
        "proxbench fclib",
        "info fclib-library/Boxes",
        "import Boxes-i100.hdf5 --output problems",
        "export funnel-100 --output funnel-100.hdf5",
    ),
)

_READING = partial(typer.Option, rich_help_panel="Reading")

Sources = Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER", help="FCLIB files, or folders of them.")]
"""Files and folders to read."""


@app.callback(invoke_without_command=True)
def _group(context: typer.Context) -> int:
    return options.require_command(context)


@app.command(
    "info",
    epilog=options.examples(
        "proxbench fclib info",
        "Boxes-i100.hdf5",
        "fclib-library --json",
    ),
)
def info(sources: Sources, as_json: options.Json = False) -> int:
    """Show the contents of FCLIB files.

    The exit code is 1 if a file in a folder cannot be read; standard error gives the reason.
    """
    from dataclasses import asdict

    from ....problems.exchange.fclib.survey import survey
    from ...report.layout.text import print_json

    found, broken = _apply(sources, lambda file, _: survey(file))
    if as_json:
        # JSON has no infinity, which a condition number can be
        rows = [{key: None if value == float("inf") else value for key, value in asdict(one).items()} for one in found]
        print_json({"files": rows, "broken": broken})
    else:
        _print_surveys(found)
        _print_broken(broken)
    return int(bool(broken))


@app.command(
    "import",
    epilog=options.examples(
        "proxbench fclib import",
        "Boxes-i100.hdf5 --output boxes.npz",
        "fclib-library --output problems --asymmetry keep",
    ),
)
def import_files(
    sources: Sources,
    output: Annotated[
        Path, options.output(metavar="FILE|FOLDER", help="Problem file (.npz), or folder for several.")
    ] = Path(),
    asymmetry: Annotated[
        Literal["symmetrise", "keep", "refuse"],
        _READING(metavar="HOW", help="Unsymmetric W: symmetrise (up to 1 %), keep or refuse."),
    ] = "symmetrise",
    force: options.Force = False,
    as_json: options.Json = False,
) -> int:
    """Read FCLIB files into problem files (.npz).

    Each file is printed with the digest of its problem. The exit code is 1 if a file in a folder cannot be read;
    standard error gives the reason.
    """
    from ....problems import read_fclib, save_problem

    targets = _import_targets(sources, output, force)

    def convert(file: Path, source: Path) -> tuple[str, str]:
        problem = read_fclib(file, asymmetry)
        save_problem(problem, targets[file])
        return str(targets[file]), problem.digest

    found, broken = _apply(sources, convert)
    _print_written(dict(found), broken, as_json)
    return int(bool(broken))


@app.command(
    "export",
    epilog=options.examples(
        "proxbench fclib export",
        "funnel-100 pile-300 --output problems",
        "problem.npz --output problem.hdf5",
    ),
)
def export(
    names: Annotated[list[str], typer.Argument(metavar="PROBLEM", help="Names of problems, or problem files.")],
    output: Annotated[
        Path, options.output(metavar="FILE|FOLDER", help="FCLIB file (.hdf5), or folder for several.")
    ] = Path(),
    plugin: options.PluginFiles = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> int:
    """Write problems as FCLIB files.

    Each file is printed with the digest of its problem.
    """
    from ....problems import write_fclib
    from ....problems.exchange.catalog import is_path
    from ....problems.exchange.fclib.conversion import contents_of
    from ....problems.exchange.fclib.files import SUFFIXES
    from ...plugins.problems import resolved
    from ...report.layout.output_file import refuse_taken

    problems = [resolved(name) for name in names]
    for problem in problems:
        contents_of(problem)  # raises before any file is written
    is_file = output.suffix in SUFFIXES and not output.is_dir()
    stems = [Path(name).stem if is_path(name) else name for name in names]  # the name inside a file may be anything
    targets = [output] if is_file else [output / f"{stem}{SUFFIX}" for stem in stems]
    _refuse_one_for_several(targets, list(names), is_file)
    refuse_taken(targets, force)
    for problem, target in zip(problems, targets, strict=True):
        write_fclib(problem, target)
    digests = {str(target): problem.digest for problem, target in zip(problems, targets, strict=True)}
    _print_written(digests, [], as_json)
    return 0


def _apply(sources: Sequence[Path], act: Callable[[Path, Path], Any]) -> tuple[list[Any], list[str]]:
    """Return what ``act`` returns for each file and its source, and a message for each file in a folder that fails.

    Raises:
        ProblemError: if a file named on the command line fails, or a folder has no file.
    """
    from ....problems.errors import ProblemError
    from ....problems.exchange.fclib.survey import fclib_files

    found, broken = [], []
    for source in sources:
        for file in fclib_files(source):
            try:
                found.append(act(file, source))
            except ProblemError as error:
                if file == source:
                    raise
                broken.append(options.spell_options(str(error)))
    return found, broken


def _import_targets(sources: Sequence[Path], output: Path, force: bool) -> dict[Path, Path]:
    """Return the problem file of each FCLIB file; files of a folder keep their relative paths.

    Raises:
        BenchError: if two files have the same target, or a target exists and ``force`` is not given.
        ProblemError: if a folder has no FCLIB files.
    """
    from ....problems.exchange.fclib.survey import fclib_files
    from ...report.layout.output_file import refuse_taken

    is_file = output.suffix == PROBLEM_SUFFIX and not output.is_dir()
    targets = {}
    for source in sources:
        for file in fclib_files(source):
            place = file.relative_to(source) if source.is_dir() else Path(file.name)
            targets[file] = output if is_file else output / place.with_suffix(PROBLEM_SUFFIX)
    _refuse_one_for_several(list(targets.values()), [str(file) for file in targets], is_file)
    refuse_taken(targets.values(), force)
    return targets


def _refuse_one_for_several(targets: Sequence[Path], sources: Sequence[str], is_file: bool) -> None:
    from ...errors import BenchError

    if is_file and len(sources) > 1:
        raise BenchError(f"{targets[0]} is one file for {len(sources)} problems; name a folder with --output.")
    first: dict[Path, str] = {}
    for target, source in zip(targets, sources, strict=True):
        if target in first:
            raise BenchError(f"{first[target]} and {source} would both be written to {target}; write one at a time.")
        first[target] = source


def _print_surveys(found: Sequence["Survey"]) -> None:
    """Print a table; the names of the files come last because they may be long."""
    heads = ("form", "contacts", "joints", "rows", "rank", "μ", "μ_r [m]", "asymmetry", "cond.", "file")
    rows = [
        (
            one.form,
            str(one.contacts),
            str(one.joints),
            str(one.rows),
            "–" if one.rank is None else str(one.rank),
            _range(one.friction),
            "–" if one.rolling_friction is None else _range(one.rolling_friction),
            f"{one.asymmetry:.1e}" if one.asymmetry else "0",
            f"{one.conditioning:.3g}",
            one.file,
        )
        for one in found
    ]
    if not rows:
        return
    widths = [max(len(line[column]) for line in (heads, *rows)) for column in range(len(heads) - 1)]
    for line in (heads, *rows):
        cells = [f"{cell:>{width}}" for cell, width in zip(line, widths, strict=False)]
        print("  ".join([f"{line[0]:<{widths[0]}}", *cells[1:], line[-1]]))
    print("\nrank: estimated; asymmetry: of W, over its largest entry; cond.: largest of a contact's block of G")


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g}" if ends[0] == ends[1] else "{:g}…{:g}".format(*ends)


def _print_written(digests: dict[str, str], broken: Sequence[str], as_json: bool) -> None:
    from ...report.layout.text import print_json

    if as_json:
        print_json({"files": digests, "broken": list(broken)})
        return
    print_files(digests)
    _print_broken(broken)


def print_files(digests: Mapping[str, str]) -> None:
    """Print files of problems, each with the digest that runs identify the problem by."""
    width = max((len(file) for file in digests), default=0)
    for file, digest in digests.items():
        print(f"{file:<{width}}  problem digest {digest[:16]}")


def _print_broken(broken: Sequence[str]) -> None:
    for sentence in broken:
        print(f"proxbench: {sentence}", file=sys.stderr)
