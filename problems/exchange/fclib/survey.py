"""What an FCLIB file holds, in numbers that say how hard its problem is: size, rank, friction, conditioning."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ...arrays import FloatArray
from ...contact.coupling import row_lengths
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from ..repair import Repair, asymmetry
from .contents import GlobalContents, LocalContents
from .conversion import problem_of
from .files import SUFFIXES, fclib_contents

RANK_TOLERANCE = 1e-9
"""Eigenvalues of the scaled G below this part of the largest one are taken for zero."""

MOST_RANK_ROWS = 8000
"""Rows up to which the rank is estimated; the factors of larger matrices can fill."""


@dataclass(frozen=True)
class Survey:
    """One FCLIB file.

    Attributes:
        file: its path.
        title: what it calls its problem.
        form: "local" or "global".
        contacts: number of contacts.
        joints: number of bilateral rows.
        rows: number of rows, 2, 3 or 5 a contact, and the bilateral ones.
        dofs: degrees of freedom; ``None`` for a local problem.
        rank: estimated rank of G; ``None`` where that is not affordable.
        friction: least and largest μ, 0 without contacts.
        rolling_friction: least and largest μ_r [m]; ``None`` without rolling friction.
        asymmetry: max |A − Aᵀ| / max |A| for A = W or R, the larger, of a local problem, M of a global one.
        conditioning: largest condition number of the block of G of one contact, inf for a singular one.
        guesses: how many guesses are stored.
        solution: judged residual of the stored solution; ``None`` if none was written.
    """

    file: str
    title: str
    form: str
    contacts: int
    joints: int
    rows: int
    dofs: int | None
    rank: int | None
    friction: tuple[float, float]
    rolling_friction: tuple[float, float] | None
    asymmetry: float
    conditioning: float
    guesses: int
    solution: float | None


def survey(path: Path) -> Survey:
    """Return what a file holds.

    Raises:
        ProblemError: as ``read_fclib``; an asymmetry of whatever size is no reason.
    """
    contents = fclib_contents(path)
    is_local = isinstance(contents, LocalContents)
    matrices = (contents.W, contents.R) if isinstance(contents, LocalContents) else (contents.M,)
    try:
        problem = _problem_of_any(contents, path.stem)
    except ProblemError as error:
        raise ProblemError(f"{path}: {error}") from None
    rolling, residual = contents.rolling_friction, problem.provenance.get("stored_solution_residual")
    return Survey(
        file=str(path),
        title=contents.about.get("title", ""),
        form="local" if is_local else "global",
        contacts=len(contents.friction),
        joints=contents.n_joints,
        rows=problem.n_rows,
        dofs=None if problem.factors is None else problem.factors.n_dofs,
        rank=estimated_rank(problem) if problem.n_rows <= MOST_RANK_ROWS else None,
        friction=_range(contents.friction),
        rolling_friction=None if rolling is None else _range(rolling),
        asymmetry=max(asymmetry(matrix) for matrix in matrices),
        conditioning=float(block_conditioning(problem).max(initial=0.0)),
        guesses=contents.guesses,
        solution=None if residual is None else float(residual),
    )


def _problem_of_any(contents: LocalContents | GlobalContents, name: str) -> ContactProblem:
    """Return the problem, with whatever remedy its matrices need; it is looked at only."""
    last = Repair("keep" if isinstance(contents, LocalContents) else "lower", "project")
    try:
        return problem_of(contents, name, Repair("mean", "project"))
    except ProblemError:
        return problem_of(contents, name, last)


def _range(values: FloatArray) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)


def fclib_files(path: Path) -> Iterator[Path]:
    """Yield the file, or all FCLIB files in a folder and its folders, in the order of their names.

    Raises:
        ProblemError: if there are none.
    """
    if not path.is_dir():
        yield path
        return
    found = sorted(file for file in path.rglob("*") if file.suffix in SUFFIXES)
    if not found:
        raise ProblemError(f"there is no file in {path} that ends in {' or '.join(SUFFIXES)}.")
    yield from found


def estimated_rank(problem: ContactProblem) -> int | None:
    """Return how many eigenvalues of the scaled D^-½ G D^-½, D its diagonal, exceed ``RANK_TOLERANCE`` of the largest.

    By Sylvester's law of inertia they are as many as the positive pivots of G − σI, factorised sparse and without
    exchanges; ``None`` where that fails. G is made symmetric before.
    """
    delassus, diagonal = problem.delassus(), problem.delassus_diagonal
    moved = np.flatnonzero(diagonal > 0.0)
    if not len(moved):
        return 0
    scale = sp.diags_array(1.0 / np.sqrt(diagonal[moved]))
    scaled: Any = scale @ sp.csr_array(0.5 * (delassus + delassus.T))[moved][:, moved] @ scale
    shift = RANK_TOLERANCE * float(abs(scaled).sum(axis=1).max())
    shifted = sp.csc_array(scaled - shift * sp.eye_array(len(moved)))
    symmetric = {"SymmetricMode": True}
    try:
        factors = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    except (RuntimeError, MemoryError):
        return None
    if not np.array_equal(factors.perm_r, factors.perm_c):
        return None
    return int((factors.U.diagonal() > 0.0).sum())


def block_conditioning(problem: ContactProblem) -> FloatArray:
    """Return the condition number of the diagonal block of G of each contact, shape (n_contacts,); inf for singular.

    Rows of rolling friction count in the judge's unit, which is a velocity; joints are left out.
    """
    blocks, layout = problem.delassus_blocks(), problem.layout
    lengths = layout.pad(row_lengths(problem))
    diagonal = (blocks.values[blocks.starts[:-1]] * lengths[:, :, None] * lengths[:, None, :])[~layout.is_bilateral]
    found: FloatArray = np.linalg.cond(diagonal) if len(diagonal) else np.zeros(0)
    return np.where(np.isfinite(found), found, np.inf)
