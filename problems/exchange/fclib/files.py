"""Read and write contact problems as FCLIB files."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import FloatArray, real_numbers
from ...contact.problem import ContactProblem
from ...errors import ProblemError
from ..files.problem_file import check_problem, write_whole
from ..repair import Indefinite, Repair, Symmetry, named_in_errors
from .container import ContainerError, open_container
from .contents import GlobalContents, LocalContents, read_contents, stored_contents
from .conversion import contents_of, digest_mismatch, problem_of
from .laws import fclib_row_order

SUFFIXES = (".hdf5", ".h5")
"""Suffixes of FCLIB files."""


def is_fclib_name(name: str) -> bool:
    """Return whether a file of this name is treated as an FCLIB file."""
    return name.endswith(SUFFIXES)


def read_fclib(path: Path | str, symmetry: Symmetry = "mean", indefinite: Indefinite = "refuse") -> ContactProblem:
    """Read the problem of an FCLIB file, and name it after the file.

    Links to other files are not followed, and no array is larger than the file. FCLIB has no checksums: a changed
    number that is still valid is detected only in files written by ``write_fclib``.

    Args:
        path: the file.
        symmetry: how an asymmetric matrix A is read, W or R of a local problem or M of a global one.
            "mean" takes (A + Aᵀ)/2 if |A − Aᵀ| is at most 1 % of the largest |A|; "lower" and "upper" take
            one triangle and ignore the other; "keep" leaves W or R unchanged; "refuse" raises. The provenance records
            the asymmetry and the remedy.
        indefinite: how a W with a negative eigenvalue is read. "refuse" raises; "project" takes the nearest
            semidefinite matrix, for eigenvalues up to 1e-6 of the largest one.

    Raises:
        ProblemError: if the file is missing, damaged, not an FCLIB file or not a valid problem, or an option has an
            unknown value.
    """
    path = Path(path)
    repair = Repair(symmetry, indefinite)
    contents = fclib_contents(path)
    with named_in_errors(str(path), "fclib", repair):
        problem = problem_of(contents, path.stem, repair, source="FCLIB", file=path.name)
        mismatch = digest_mismatch(contents, problem)
    if mismatch:
        raise ProblemError(f"{path} is damaged: {mismatch}; write it again.")
    return problem


def fclib_contents(path: Path) -> LocalContents | GlobalContents:
    """Return the contents of an FCLIB file, unchanged.

    Raises:
        ProblemError: if the file is missing, damaged or not an FCLIB file.
    """
    try:
        with open_container(path) as file:
            return read_contents(file)
    except FileNotFoundError:
        raise ProblemError(f"there is no problem file {path}.") from None
    except ContainerError as error:
        raise ProblemError(f"{path} is damaged or not an FCLIB file: {error}.") from None


def write_fclib(problem: ContactProblem, path: Path | str, impulses: ArrayLike | None = None) -> None:
    """Write a problem as an FCLIB file atomically.

    A problem with factors becomes a global one, and one with a Delassus matrix a local one. The matrices, μ, μ_r, q and
    s of a problem from an FCLIB file are written exactly. If only M⁻¹ is known and has blocks of more than one degree
    of freedom, M is its inverse up to rounding, and the problem has a different digest when it is read. The same holds
    if joints precede contacts, because FCLIB stores joints last.

    Args:
        problem: contacts with Coulomb friction, all planar or all spatial, and joints. A problem with rolling friction,
            about the axis of the plane or both tangents, must have factors.
        path: the file, ending in .hdf5 or .h5; its folder is created.
        impulses: Λ [N s], shape (n_rows,), to be stored as the solution; the known solution if None.

    Raises:
        ProblemError: if FCLIB cannot represent the laws, the impulses have the wrong shape or are not finite, the name
            has a different ending, or the file cannot be written.
    """
    check_problem(problem, "write_fclib")
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise ProblemError(f"FCLIB files end in {SUFFIXES[0]}, and {path} does not; name it {path.stem}{SUFFIXES[0]}.")
    if impulses is None and problem.answer is not None:
        impulses = problem.answer.witness
    contents = contents_of(problem)
    solution = _solution(problem, contents, impulses)
    write_whole(path, _hdf5_content(stored_contents(contents) | solution))


def _solution(
    problem: ContactProblem, contents: LocalContents | GlobalContents, given_impulses: ArrayLike | None
) -> dict[str, FloatArray]:
    """Return r, u, λ of joints and, for a global problem, v by path; empty without impulses."""
    if given_impulses is None:
        return {}
    impulses = np.asarray(real_numbers(given_impulses, "impulses"), dtype=np.float64)
    if impulses.shape != (problem.n_rows,) or not np.isfinite(impulses).all():
        raise ProblemError(f"impulses must be {problem.n_rows} finite numbers, got shape {impulses.shape}.")
    order, n = fclib_row_order(problem), contents.n_contact_rows
    r, joints, u = impulses[order[:n]], impulses[order[n:]], problem.relative_velocity(impulses)[order[:n]]
    solution = {"solution/r": r, "solution/u": u} | ({"solution/l": joints} if len(joints) else {})
    if isinstance(contents, GlobalContents) and problem.factors is not None:
        total_impulse = contents.f + contents.H @ r + contents.G @ joints
        solution["solution/v"] = problem.factors.inverse_mass.times(total_impulse)
    return solution


def _hdf5_content(data: dict[str, NDArray[np.generic] | bytes]) -> bytes:
    """Return the content of an HDF5 file that all versions of the library read; byte strings are null-terminated."""
    import h5py

    with h5py.File("fclib", "w", driver="core", backing_store=False, libver=("earliest", "v110")) as file:
        for name, values in data.items():
            is_text = isinstance(values, bytes)
            file.create_dataset(name, data=np.array(values, dtype=f"S{len(values) + 1}") if is_text else values)
        file.flush()
        content: bytes = file.id.get_file_image()
    return content
