"""Captured steps as files of ``save_problem`` with additional arrays about the engine.

The names of the additional arrays begin with ``capture.``; readers of the problem ignore them.
"""

import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import ProblemError
from ..exchange.files.archive import DAMAGE_ERRORS, ArchiveError, read_arrays
from ..exchange.files.problem_file import packed_problem, read_problem, write_whole
from .engine_model import EngineModel
from .rows import RefusedRow
from .step import CapturedStep

FORMAT = 2
"""Version of the additional arrays."""

_PREFIX = "capture."
_VECTORS = ("regularisation", "offset", "kind", "first_row", "coefficient", "bound", "forces", "impulses")
_PLAIN = ("scale", "engine", "solver", "iterations")


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
        ProblemError: if the file is not from ``save_step``, or is damaged.
    """
    path = Path(path)
    problem = read_problem(path)
    try:
        content = read_arrays(path)
    except ArchiveError as error:
        raise ProblemError(f"{path} is damaged: {error}; capture it again.") from None
    found = {key.removeprefix(_PREFIX): value for key, value in content.items() if key.startswith(_PREFIX)}
    if "about" not in found:
        raise ProblemError(f"{path} contains a problem but no captured step; create one with proxbench capture.")
    try:
        about = json.loads(found["about"].tobytes().decode())
        if about["format"] != FORMAT:
            raise ProblemError(f"{path} has captured data of format {about['format']}, not {FORMAT}; capture it again.")
        n_rows = len(found["offset"])
        engine = EngineModel(
            matrix=sp.csr_array((found["A.data"], found["A.indices"], found["A.indptr"]), shape=(n_rows, n_rows)),
            **{**{name: found[name] for name in _VECTORS}, **about["engine"]},
        )
        engine.matrix.check_format(full_check=True)
        refused = tuple(RefusedRow(**one) for one in about["refused"])
        return CapturedStep(problem, engine, found["anchors"], refused)
    except ProblemError:
        raise
    except DAMAGE_ERRORS:
        raise ProblemError(f"the captured data of {path} are damaged; capture it again.") from None


def _arrays(step: CapturedStep) -> dict[str, Any]:
    engine = step.engine
    about = {
        "format": FORMAT,
        "engine": {name: getattr(engine, name) for name in _PLAIN},
        "refused": [asdict(one) for one in step.refused],
    }
    matrix = {f"A.{part}": getattr(engine.matrix, part) for part in ("data", "indices", "indptr")}
    arrays = {
        "about": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8),
        "anchors": step.anchors,
        **matrix,
        **{name: getattr(engine, name) for name in _VECTORS},
    }
    return {f"{_PREFIX}{name}": value for name, value in arrays.items()}
