"""The commands ``proxbench info``, ``import`` and ``export``: inspect, read and write problem files in any format."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from .. import options

if TYPE_CHECKING:
    from ....problems.contact.problem import ContactProblem
    from ....problems.exchange.repair import Indefinite, Symmetry
    from ....problems.exchange.survey import Survey

PROBLEM_SUFFIX = ".npz"
"""Suffix of problem files."""

EXPORT_SUFFIXES = {"fclib": ".hdf5", "npz": ".npz", "json": ".json"}
"""Suffix of files in each export format."""

_reading = partial(typer.Option, rich_help_panel="Reading")

Sources = Annotated[list[Path], typer.Argument(metavar="FILE|FOLDER", help="Problem files, or folders of them.")]
"""Files and folders to read."""


def info(sources: Sources, as_json: options.Json = False) -> int:
    """Show sizes, ranks, friction and conditioning of problem files.

    For steps with the engine's own model, also show the residuals of its forces.

    The exit code is 1 if a file in a folder cannot be read, 2 if a named file cannot; standard error gives the reason.
    """
    from dataclasses import asdict

    from ....problems.exchange.survey import problem_files
    from ...report.layout.text import print_json

    results, broken, code = _apply(sources, problem_files, lambda file, _: _survey_file(file))
    if as_json:
        # a condition number may be infinite, which JSON cannot represent
        rows = [
            {key: None if value == float("inf") else value for key, value in asdict(survey).items()}
            | {"engine": engine}
            for survey, engine in results
        ]
        print_json({"files": rows, "broken": broken})
    else:
        _print_surveys([survey for survey, _ in results], [engine for _, engine in results])
        options.print_notes(*broken)
    return code


def _survey_file(file: Path) -> tuple["Survey", dict[str, Any] | None]:
    """Return the survey of a file and the quality of the engine's forces, None if it has no model."""
    from ....problems.capture.files import has_step, read_step
    from ....problems.exchange.survey import survey
    from .capture import engine_quality

    _require_problem_file(file)
    file_survey = survey(file)
    if has_step(file):
        step = read_step(file)
        return file_survey, {"name": step.engine.name, **engine_quality(step)}
    if file_survey.own_solution is None:
        return file_survey, None
    return file_survey, {"own model": file_survey.own_solution, "Coulomb": file_survey.solution}


def _require_problem_file(file: Path) -> None:
    """Raise ``ProblemError`` for the name of a problem of the library, or the file of a simulation."""
    from ....problems.errors import ProblemError
    from ....problems.exchange.catalog import problem_names
    from ...simulation.file import is_result

    if not file.exists() and str(file) in problem_names():
        raise ProblemError(
            f"{file} is a problem by name, not a file; show it by: proxbench list problems {quote(str(file))}."
        )
    if file.suffix == ".npz" and file.exists() and is_result(file):
        raise ProblemError(
            f"{file} holds a simulation, not a problem; show it by: proxbench report {quote(str(file))}."
        )


def import_files(
    file_format: Annotated[
        Literal["fclib", "contactbench", "kamino", "bodies", "plain"],
        typer.Argument(metavar="FORMAT", help="fclib, contactbench, kamino, bodies or plain."),
    ],
    sources: Sources,
    output: Annotated[
        Path, options.output(metavar="FILE|FOLDER", help="Problem file (.npz), or folder for several.")
    ] = Path(),
    symmetry: Annotated[
        str,
        _reading(metavar="HOW", help="For asymmetric matrices: mean (up to 1 %), lower, upper, keep or refuse."),
    ] = "mean",
    indefinite: Annotated[
        str, _reading(metavar="HOW", help="For negative eigenvalues: refuse or project (up to 1e-6).")
    ] = "refuse",
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Convert files of other programs to problem files (.npz).

    Captured steps keep the engine's forces. Print the name of each file and the digest of its problem.

    The exit code is 1 if a file in a folder cannot be read, 2 if a named file cannot; standard error gives the reason.
    """
    from ....problems import save_problem
    from ....problems.capture.files import has_step, read_step, save_step
    from ....problems.exchange.survey import problem_files

    read, suffixes = _reader(file_format, symmetry, indefinite)
    files_of = partial(problem_files, suffixes=suffixes)
    targets = _import_targets(sources, files_of, output, force)

    def convert(file: Path, source: Path) -> tuple[str, str]:
        problem = read(file)
        if has_step(file):
            save_step(replace(read_step(file), problem=problem), targets[file])
        else:
            save_problem(problem, targets[file])
        return str(targets[file]), problem.digest

    written, broken, code = _apply(sources, files_of, convert)
    _print_written(dict(written), broken, quiet, as_json)
    return code


def export_files(
    file_format: Annotated[
        Literal["fclib", "npz", "json"], typer.Argument(metavar="FORMAT", help="fclib, npz or json.")
    ],
    names: Annotated[list[str], typer.Argument(metavar="PROBLEM", help="Names of problems, or problem files.")],
    output: Annotated[Path, options.output(metavar="FILE|FOLDER", help="File, or folder for several.")] = Path(),
    plugin: options.PluginFiles = None,
    force: options.Force = False,
    quiet: options.Quiet = False,
    as_json: options.Json = False,
) -> int:
    """Write problems as files for other programs.

    Forces of captured steps are left out. Print the name of each file and the digest of its problem.
    """
    from ....problems import save_problem, write_fclib
    from ....problems.exchange.catalog import is_path
    from ....problems.exchange.fclib.conversion import contents_of
    from ...plugins.problems import resolve_problem
    from ...report.layout.output_file import check_writable

    problems = [resolve_problem(name) for name in names]
    write: Callable[[ContactProblem, Path], None] = save_problem
    if file_format == "fclib":
        write = write_fclib
        for problem in problems:
            contents_of(problem)  # raises before any file is written
    suffix = EXPORT_SUFFIXES[file_format]
    is_file = _is_file(output, suffix)
    stems = [Path(name).stem if is_path(name) else name for name in names]  # the name inside a file is arbitrary
    targets = [output] if is_file else [output / f"{stem}{suffix}" for stem in stems]
    _check_targets(targets, list(names), is_file)
    check_writable(targets, force)
    for problem, target in zip(problems, targets, strict=True):
        write(problem, target)
    digests = {str(target): problem.digest for problem, target in zip(problems, targets, strict=True)}
    _print_written(digests, [], quiet, as_json)
    return 0


def _reader(
    file_format: str, symmetry: str, indefinite: str
) -> tuple[Callable[[Path], "ContactProblem"], tuple[str, ...]]:
    """Return the reader of a format, and the suffixes of its files.

    Raises:
        ProblemError: if an option has an unknown value.
    """
    from typing import cast

    from ....problems import read_fclib
    from ....problems.contact.problem import UNNAMED
    from ....problems.exchange.fclib.files import SUFFIXES as FCLIB_SUFFIXES
    from ....problems.exchange.files.problem_file import SUFFIXES, read_problem
    from ....problems.exchange.repair import Repair

    repair = Repair(cast("Symmetry", symmetry), cast("Indefinite", indefinite))
    if file_format == "fclib":
        return lambda file: read_fclib(file, repair.symmetry, repair.indefinite), FCLIB_SUFFIXES

    def read(file: Path) -> "ContactProblem":
        problem = read_problem(file, repair=repair, format_name=file_format)
        return problem.renamed(file.stem) if problem.name == UNNAMED else problem

    return read, SUFFIXES


def _apply(
    sources: Sequence[Path], files_of: Callable[[Path], Any], function: Callable[[Path, Path], Any]
) -> tuple[list[Any], list[str], int]:
    """Apply ``function`` to each file and its source; return results, messages for failed files, and the exit code.

    Raises:
        ProblemError: if the only file named on the command line fails, or a folder has no file.
    """
    from ....problems.errors import ProblemError

    results, broken, code = [], [], 0
    for source in sources:
        for file in files_of(source):
            try:
                results.append(function(file, source))
            except ProblemError as error:
                if file == source and len(sources) == 1:
                    raise
                broken.append(options.with_option_names(str(error)))
                code = max(code, 2 if file == source else 1)
    return results, broken, code


def _import_targets(
    sources: Sequence[Path], files_of: Callable[[Path], Any], output: Path, force: bool
) -> dict[Path, Path]:
    """Return the path of the problem file for each input file; files of a folder keep their relative paths.

    Raises:
        BenchError: if two files have the same target, a target exists and ``force`` is not given, or the output has the
            suffix of another format.
        ProblemError: if a folder has no files of the format.
    """
    from ...report.layout.output_file import check_writable

    is_file = _is_file(output, PROBLEM_SUFFIX)
    targets = {}
    for source in sources:
        for file in files_of(source):
            path = file.relative_to(source) if source.is_dir() else Path(file.name)
            targets[file] = output if is_file else output / path.with_suffix(PROBLEM_SUFFIX)
    _check_targets(list(targets.values()), [str(file) for file in targets], is_file)
    check_writable(targets.values(), force)
    return targets


def _is_file(output: Path, suffix: str) -> bool:
    """Return whether the output is one file, and not a folder.

    Raises:
        BenchError: if it has another suffix and no such folder exists; a number, as in ``v1.2``, is not a suffix.
    """
    from ...errors import BenchError

    if output.is_dir() or not output.suffix or output.suffix[1:].isdecimal():
        return False
    if output.suffix != suffix:
        raise BenchError(
            f"{output} is neither a {suffix} file nor a folder that exists; name a file that ends in {suffix}, or a "
            "folder without a suffix, with --output."
        )
    return True


def _check_targets(targets: Sequence[Path], sources: Sequence[str], is_file: bool) -> None:
    """Raise ``BenchError`` if several sources have the same target."""
    from ...errors import BenchError

    if is_file and len(sources) > 1:
        raise BenchError(f"{targets[0]} is one file for {len(sources)} problems; name a folder with --output.")
    sources_by_target: dict[Path, str] = {}
    for target, source in zip(targets, sources, strict=True):
        if target in sources_by_target:
            raise BenchError(
                f"{sources_by_target[target]} and {source} would both be written to {target}; write one at a time."
            )
        sources_by_target[target] = source


def _print_surveys(surveys: Sequence["Survey"], engines: Sequence[dict[str, Any] | None]) -> None:
    """Print a table, with the file names in the last column because they may be long."""
    from .capture import cell

    residual_names = ("own model", "Coulomb") if any(engines) else ()
    headings = (
        "form",
        "contacts",
        "joints",
        "rows",
        "rank",
        "μ",
        "μ_r [m]",
        "asymmetry",
        "cond.",
        "guesses",
        "solution",
        *residual_names,
        "file",
    )
    rows = [
        (
            survey.form,
            str(survey.contacts),
            str(survey.joints),
            str(survey.rows),
            "–" if survey.rank is None else str(survey.rank),
            _range_text(survey.friction),
            "–" if survey.rolling_friction is None else _range_text(survey.rolling_friction),
            f"{survey.asymmetry:.1e}" if survey.asymmetry else "0",
            f"{survey.conditioning:.3g}",
            str(survey.guesses or "–"),
            "–" if survey.solution is None else f"{survey.solution:.1e}",
            *("–" if engine is None else cell(engine[name]) for name in residual_names),
            survey.file,
        )
        for survey, engine in zip(surveys, engines, strict=True)
    ]
    if not rows:
        return
    widths = [max(len(line[column]) for line in (headings, *rows)) for column in range(len(headings) - 1)]
    for line in (headings, *rows):
        cells = [f"{text:>{width}}" for text, width in zip(line, widths, strict=False)]
        print("  ".join([f"{line[0]:<{widths[0]}}", *cells[1:], line[-1]]))
    print(
        "\nrank: estimated; asymmetry: of W or M, over its largest entry; cond.: largest of the contacts' blocks of G; "
        "solution: judged residual of the stored impulses"
    )
    if residual_names:
        print("own model: residual of the engine's forces in the model that it solves; Coulomb: judged residual")


def _range_text(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:g}" if bounds[0] == bounds[1] else "{:g}…{:g}".format(*bounds)


def _print_written(digests: dict[str, str], broken: Sequence[str], quiet: bool, as_json: bool) -> None:
    from ...report.layout.text import print_json

    if as_json:
        print_json({"files": digests, "broken": list(broken)})
        return
    print_files(digests, quiet)
    options.print_notes(*broken)


def print_files(digests: Mapping[str, str], quiet: bool = False) -> None:
    """Print problem files with the digests that identify the problems in runs; ``quiet`` omits the digests."""
    width = max((len(file) for file in digests), default=0)
    for file, digest in digests.items():
        print(file if quiet else f"{file:<{width}}  problem digest {digest[:16]}")
