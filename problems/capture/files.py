"""Captured steps as files of ``save_problem`` with additional arrays about the engine.

The names of the additional arrays begin with ``capture.``; readers of the problem ignore them. The engine's model is
part of the problem. Its forces are not, because solvers must not see them.
"""

import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ProblemError
from ..exchange.files.archive import DAMAGE_ERRORS, ArchiveError, read_arrays
from ..exchange.files.problem_file import packed_problem, read_problem, write_whole
from .rows import RefusedRow
from .step import CapturedStep

FORMAT = 3
"""Version of the additional arrays."""

_PREFIX = "capture."


def save_step(step: CapturedStep, path: Path) -> None:
    """Write a captured step to a problem file atomically."""
    write_whole(path, packed_problem(step.problem, _arrays(step)))


def has_step(path: Path) -> bool:
    """Return whether a file contains a captured step."""
    try:
        with zipfile.ZipFile(path) as archive:
            return f"{_PREFIX}about.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def read_step(path: Path | str) -> CapturedStep:
    """Read a captured step.

    Raises:
        ProblemError: if the file contains no captured step or one of another format, or is damaged.
    """
    path = Path(path)
    problem = read_problem(path)
    try:
        content = read_arrays(path)
    except ArchiveError as error:
        raise ProblemError(f"{path} is damaged: {error}; capture it again.") from None
    arrays = {key.removeprefix(_PREFIX): value for key, value in content.items() if key.startswith(_PREFIX)}
    if "about" not in arrays:
        raise ProblemError(f"{path} contains a problem but no captured step; create one with proxbench capture.")
    try:
        about = json.loads(arrays["about"].tobytes().decode())
        if about["format"] != FORMAT:
            raise ProblemError(f"{path} has captured data of format {about['format']}, not {FORMAT}; capture it again.")
        refused = tuple(RefusedRow(**row) for row in about["refused"])
        if problem.engine is None or arrays["forces"].shape != problem.engine.offset.shape:
            raise ValueError("the forces are not those of the rows of the engine")
        return CapturedStep(
            problem, arrays["forces"], str(about["solver"]), int(about["iterations"]), arrays["anchors"], refused
        )
    except ProblemError:
        raise
    except DAMAGE_ERRORS:
        raise ProblemError(f"the captured data of {path} are damaged; capture it again.") from None


def _arrays(step: CapturedStep) -> dict[str, Any]:
    """Return the additional arrays of a step, by name."""
    about = {
        "format": FORMAT,
        "solver": step.solver,
        "iterations": step.iterations,
        "refused": [asdict(row) for row in step.refused],
    }
    text = np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8)
    arrays = {"about": text, "forces": step.forces, "anchors": step.anchors}
    return {f"{_PREFIX}{name}": value for name, value in arrays.items()}
