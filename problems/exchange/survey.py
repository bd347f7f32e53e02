"""Numbers that describe the difficulty of a problem file: size, rank, friction, conditioning."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ..arrays import FloatArray
from ..contact.coupling import row_lengths
from ..contact.problem import ContactProblem
from ..errors import ProblemError
from .fclib.conversion import GUESSES
from .fclib.files import SUFFIXES as FCLIB_SUFFIXES
from .fclib.files import is_fclib_name, read_fclib
from .files.problem_file import SUFFIXES, read_problem
from .repair import ASYMMETRY, Repair
from .stored_solution import OWN_RESIDUAL_KEY, RESIDUAL_KEY

RANK_TOLERANCE = 1e-9
"""Eigenvalues of the scaled G below this fraction of its largest absolute row sum count as zero."""

MAX_RANK_ROWS = 8000
"""Largest number of rows for which the rank is estimated; larger matrices may have dense factors."""

_REPAIRS = tuple(Repair(symmetry, "project") for symmetry in ("mean", "keep", "lower", "upper"))
"""Repairs that follow the default one, in the order of trials, so that any asymmetric matrix can be described."""


@dataclass(frozen=True)
class Survey:
    """The description of one file.

    Attributes:
        file: path of the file.
        title: title of the problem; may be empty.
        form: "G" or "factors", the form in which the problem is stored.
        contacts: number of contacts.
        joints: number of bilateral rows.
        rows: number of rows.
        dofs: degrees of freedom; ``None`` if the problem has G only.
        rank: estimated rank of G; ``None`` if G is too large or its factorisation fails.
        friction: smallest and largest μ, 0 without friction.
        rolling_friction: smallest and largest μ_r [m]; ``None`` without rolling friction.
        asymmetry: max |A − Aᵀ| / max |A| of its Delassus or mass matrix, 0 within rounding.
        conditioning: largest condition number of the diagonal block of G of a contact, inf if singular.
        guesses: number of stored guesses.
        solution: the judge's residual of the stored impulses; ``None`` if there are none.
        own_solution: residual of these impulses in the engine's own model; ``None`` without such a model.
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
    own_solution: float | None


def survey(path: Path) -> Survey:
    """Return the description of a file.

    Raises:
        ProblemError: if the file contains no problem; any asymmetry is allowed.
    """
    problem = _read(path)
    laws, provenance = problem.laws, problem.provenance
    rolling = laws.friction_coefficient[laws.is_rolling]
    residual, own_residual = (provenance.get(key) for key in (RESIDUAL_KEY, OWN_RESIDUAL_KEY))
    joints = laws.n_joint_rows
    return Survey(
        file=str(path),
        title=str(provenance.get("title", "")),
        form="G" if problem.factors is None else "factors",
        contacts=problem.n_contacts - joints,
        joints=joints,
        rows=problem.n_rows,
        dofs=None if problem.factors is None else problem.factors.n_dofs,
        rank=estimated_rank(problem) if problem.n_rows <= MAX_RANK_ROWS else None,
        friction=_range(laws.friction_coefficient[laws.is_friction & ~laws.is_rolling]),
        rolling_friction=_range(rolling) if len(rolling) else None,
        asymmetry=float(provenance.get(ASYMMETRY, 0.0)),
        conditioning=float(block_conditioning(problem).max(initial=0.0)),
        guesses=int(provenance.get(GUESSES, 0)),
        solution=None if residual is None else float(residual),
        own_solution=None if own_residual is None else float(own_residual),
    )


def _read(path: Path) -> ContactProblem:
    """Return the problem of a file, read with the first repair that applies.

    Raises:
        ProblemError: if no repair applies; the error is that of the default repair.
    """
    try:
        return _read_with(path, Repair())
    except ProblemError as error:
        for repair in _REPAIRS:
            with suppress(ProblemError):
                return _read_with(path, repair)
        raise error


def _read_with(path: Path, repair: Repair) -> ContactProblem:
    if is_fclib_name(path.name):
        return read_fclib(path, repair.symmetry, repair.indefinite)
    return read_problem(path, repair=repair)


def _range(values: FloatArray) -> tuple[float, float]:
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)


def problem_files(path: Path, suffixes: tuple[str, ...] = (*FCLIB_SUFFIXES, *SUFFIXES)) -> Iterator[Path]:
    """Yield ``path`` if it is not a folder, else the files below it that have one of the suffixes, sorted by path.

    Raises:
        ProblemError: if the folder has no such file.
    """
    if not path.is_dir():
        yield path
        return
    files = sorted(file for file in path.rglob("*") if file.suffix in suffixes)
    if not files:
        raise ProblemError(f"there is no file in {path} that ends in {' or '.join(suffixes)}.")
    yield from files


def estimated_rank(problem: ContactProblem) -> int | None:
    """Return the number of eigenvalues above σ of A = D^-½ G D^-½, where D is the diagonal of G.

    σ is ``RANK_TOLERANCE`` times the largest absolute row sum of A, a bound on its eigenvalues. By Sylvester's law of
    inertia, the number is that of positive pivots in a sparse factorisation of A − σI without row exchanges; ``None``
    if that fails. G is symmetrised first.
    """
    delassus, diagonal = problem.delassus(), problem.delassus_diagonal
    active_rows = np.flatnonzero(diagonal > 0.0)
    if not len(active_rows):
        return 0
    scale = sp.diags_array(1.0 / np.sqrt(diagonal[active_rows]))
    scaled: Any = scale @ sp.csr_array(0.5 * (delassus + delassus.T))[active_rows][:, active_rows] @ scale
    shift = RANK_TOLERANCE * float(abs(scaled).sum(axis=1).max())
    shifted = sp.csc_array(scaled - shift * sp.eye_array(len(active_rows)))
    options = {"SymmetricMode": True}
    try:
        factors = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except (RuntimeError, MemoryError):
        return None
    if not np.array_equal(factors.perm_r, factors.perm_c):
        return None
    return int((factors.U.diagonal() > 0.0).sum())


def block_conditioning(problem: ContactProblem) -> FloatArray:
    """Return the condition number of the diagonal block of G of each contact, inf if singular.

    Rows of rolling friction are converted to velocities as in the judge. Joints are omitted.
    """
    blocks, layout = problem.delassus_blocks(), problem.layout
    lengths = layout.pad(row_lengths(problem))
    diagonal = (blocks.values[blocks.starts[:-1]] * lengths[:, :, None] * lengths[:, None, :])[~layout.is_bilateral]
    conditions: FloatArray = np.linalg.cond(diagonal) if len(diagonal) else np.zeros(0)
    return np.where(np.isfinite(conditions), conditions, np.inf)
