"""Problem files: arrays without pickle, compressed or as JSON, written atomically and verified by their digest."""

import io
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import IO, Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import compressed_arrays, compressed_matrix
from ...contact.answer import Answer
from ...contact.laws import Laws
from ...contact.matrices.factors import Factors, InverseMass
from ...contact.matrices.user_matrices import check_finite
from ...contact.problem import ContactProblem
from ...engine_model import EngineModel
from ...errors import ProblemError
from ..formats.registry import read_foreign_arrays
from ..repair import Repair
from .archive import DAMAGE_ERRORS, ArchiveError, read_arrays
from .atomic_file import replacing
from .json_arrays import SUFFIX as JSON_SUFFIX
from .json_arrays import json_text, read_json

FORMAT = 3
"""Newest version of the file format."""

CONTACTS_ONLY, ALL_LAWS = 1, 2
"""Versions for problems with contacts only, and for those with all laws but without the model of an engine."""

SUFFIX = ".npz"
"""Suffix of compressed problem files."""

SUFFIXES = (SUFFIX, JSON_SUFFIX)
"""Suffixes of problem files."""

REWRITE_REMEDY = "create it again with proxbench generate, save_problem, or numpy.savez of G, c and mu"
"""Remedy for a file that is not a problem."""

_LAW_FIELDS = [field.name for field in fields(Laws)]


def save_problem(problem: ContactProblem, path: Path | str) -> None:
    """Write a problem to a file, which ``load`` reads; an existing file is replaced atomically.

    Args:
        problem: the problem, with its name, provenance and known answer.
        path: the file, ending in .npz or .json; its folder is created.

    Raises:
        ProblemError: if ``problem`` is not a contact problem, the file cannot be written, or its name has a different
            suffix.
    """
    check_problem(problem, "save_problem")
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise ProblemError(
            f"problem files end in {' or '.join(SUFFIXES)}, and {path} does not; name it {path.stem}{SUFFIX}."
        )
    is_json = path.suffix == JSON_SUFFIX
    write_whole(path, json_text(*_description_and_arrays(problem)).encode() if is_json else packed_problem(problem))


def check_problem(problem: object, function: str) -> None:
    """Raise ``ProblemError`` unless the first argument of ``function`` is a contact problem."""
    if not isinstance(problem, ContactProblem):
        raise ProblemError(f"{function} takes a ContactProblem, not a value of type {type(problem).__name__}.")


def check_folder(folder: Path) -> None:
    """Raise ``ProblemError`` if a folder for problem files, or a folder above it, is a file."""
    candidates = (folder, *folder.parents)
    blocking = next(
        (candidate for candidate in candidates if os.path.exists(candidate) and not os.path.isdir(candidate)), None
    )
    if blocking is not None:
        raise ProblemError(f"cannot write to {folder}: {blocking} is a file, not a folder; choose another folder.")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file of a problem atomically, and create its folder.

    Raises:
        ProblemError: if the file cannot be written.
    """
    check_folder(path.parent)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(content)
    except OSError as error:
        raise ProblemError(f"cannot write {path}: {error.strerror}; choose a folder that is writable.") from None


def packed_problem(problem: ContactProblem, extra_arrays: Mapping[str, NDArray[Any]] | None = None) -> bytes:
    """Return ``problem`` as the content of a problem file, compressed, with the further arrays ``extra_arrays``."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **{**_arrays(problem), **(extra_arrays or {})})
    return buffer.getvalue()


def problem_bytes(problem: ContactProblem) -> bytes:
    """Return ``problem`` as the content of a problem file, not compressed."""
    buffer = io.BytesIO()
    np.savez(buffer, **_arrays(problem))
    return buffer.getvalue()


def read_problem(
    source: Path | IO[bytes],
    label: str = "",
    repair: Repair = Repair(),  # noqa: B008  frozen
    format_name: str = "",
) -> ContactProblem:
    """Read one problem, from a file of ``save_problem`` or in one of the formats in ``formats``.

    Args:
        source: path or open binary file; a path that ends in .json is read as JSON.
        label: name of the file in messages; its path if empty.
        repair: how an asymmetric or indefinite matrix of a foreign file is read.
        format_name: the foreign format; inferred from the names of the arrays if empty.

    Raises:
        ProblemError: if the file is missing, damaged or of an unknown format, or does not match its own digest.
    """
    name = label or str(source)
    try:
        about, arrays = _contents(source)
        if not about and (foreign := read_foreign_arrays(arrays, name, repair, format_name)) is not None:
            return foreign
        with _prefixed(name):
            problem, digest = _problem(about, arrays)
    except FileNotFoundError:
        raise ProblemError(f"there is no problem file {name}.") from None
    except IsADirectoryError:
        raise ProblemError(f"{name} is a folder, not a problem file; name a file in it.") from None
    except ArchiveError as error:
        raise ProblemError(f"{name} is damaged or not a problem file: {error}; {REWRITE_REMEDY}.") from None
    except ProblemError:
        raise
    except (OSError, *DAMAGE_ERRORS):
        raise ProblemError(f"{name} is damaged or not a problem file; {REWRITE_REMEDY}.") from None
    if problem.digest != digest:
        raise ProblemError(f"{name} does not match its digest; {REWRITE_REMEDY}.")
    return problem


@contextmanager
def _prefixed(name: str) -> Iterator[None]:
    """Put the name of a file before the message of a ``ProblemError``."""
    try:
        yield
    except ProblemError as error:
        raise ProblemError(f"{name}: {error}") from None


def _contents(source: Path | IO[bytes]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the description, empty in a foreign file, and the arrays of a file."""
    if isinstance(source, Path) and source.suffix == JSON_SUFFIX:
        return read_json(source)
    arrays = read_arrays(source)
    about = json.loads(arrays.pop("about").tobytes().decode()) if "about" in arrays else {}
    if not isinstance(about, dict):
        raise ValueError("its array 'about' is not a JSON object")
    return about, arrays


def _arrays(problem: ContactProblem) -> dict[str, Any]:
    """Return the arrays of a .npz file."""
    about, arrays = _description_and_arrays(problem)
    return {"about": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), dtype=np.uint8), **arrays}


def _description_and_arrays(problem: ContactProblem) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the description and the arrays of a problem."""
    about = {
        "format": _format_of(problem),
        "name": problem.name,
        "provenance": dict(problem.provenance),
        "digest": problem.digest,
        "allow_asymmetric": problem.allow_asymmetric,
        **({"keys": problem.keys} if problem.keys else {}),
        **({"engine": problem.engine.name} if problem.engine is not None else {}),
    }
    arrays: dict[str, Any] = {
        "c": problem.free_velocity,
        **{key: _with_short_indices(getattr(problem.laws, key)) for key in _LAW_FIELDS},
    }
    if problem.factors is not None:
        arrays |= _compressed("W", problem.factors.force_directions)
        arrays |= _compressed("Minv", problem.factors.inverse_mass.matrix)
        if problem.factors.inverse_mass.mass is not None:
            arrays |= _compressed("M", problem.factors.inverse_mass.mass)
        if problem.factors.free_motion is not None:
            arrays["free_motion"] = problem.factors.free_motion
    else:
        arrays |= _compressed("G", problem.delassus())
    if problem.engine is not None:
        arrays |= {label: _with_short_indices(array) for label, array in problem.engine.labelled_arrays().items()}
    known = {} if problem.answer is None else vars(problem.answer)
    for key, value in known.items():
        if value is None or (key == "impulses" and not value):
            continue
        arrays[f"answer.{key}"] = np.array(value)
    return about, arrays


def _format_of(problem: ContactProblem) -> int:
    """Return the oldest version that can hold a problem."""
    if problem.engine is not None:
        return FORMAT
    return CONTACTS_ONLY if problem.layout.has_contacts_only else ALL_LAWS


def _with_short_indices(array: NDArray[Any]) -> NDArray[Any]:
    """Return indices in 32 bits, and any other numbers as they are."""
    return array.astype(np.int32) if array.dtype == np.int64 else array


def _compressed(label: str, matrix: Any) -> dict[str, Any]:
    """Return the arrays of a CSR or CSC matrix, with 32-bit indices; the digest does not depend on their type."""
    return {name: _with_short_indices(array) for name, array in compressed_arrays(label, matrix).items()}


def _problem(about: dict[str, Any], arrays: dict[str, Any]) -> tuple[ContactProblem, str]:
    """Return the problem with a description and arrays, and the digest that the description states."""
    if not (isinstance(about.get("name"), str) and isinstance(about.get("provenance"), dict)):
        raise ValueError("'about' has no name or no provenance")
    if about["format"] not in (CONTACTS_ONLY, ALL_LAWS, FORMAT):
        raise ProblemError(
            f"it has format {about['format']}, but this version reads formats up to {FORMAT}; update Proxbench."
        )
    laws = Laws(*(arrays[key] for key in _LAW_FIELDS))
    attributes = {
        "name": about["name"],
        "provenance": about["provenance"],
        "answer": _answer(arrays),
        "allow_asymmetric": about["allow_asymmetric"],
        "keys": tuple(map(str, about.get("keys", ()))),
        "engine": EngineModel.of_arrays(str(about["engine"]), arrays) if "engine" in about else None,
    }
    if "G.data" in arrays:
        matrix = compressed_matrix(sp.csr_array, arrays, "G")
        return ContactProblem(arrays["c"], laws, matrix=matrix, **attributes), about["digest"]
    directions = compressed_matrix(sp.csc_array, arrays, "W")
    inverse = InverseMass.create(compressed_matrix(sp.csr_array, arrays, "Minv"))
    if "M.data" in arrays:
        mass = compressed_matrix(sp.csr_array, arrays, "M")
        if mass.shape != inverse.matrix.shape:
            raise ValueError("M and M⁻¹ have different shapes")
        check_finite(mass, "M")
        inverse = InverseMass(inverse.matrix, mass)
    factors = Factors.create(directions, inverse, arrays.get("free_motion"))
    return ContactProblem(arrays["c"], laws, factors=factors, **attributes), about["digest"]


def _answer(arrays: dict[str, Any]) -> Answer | None:
    """Return the known answer among the arrays of a file, or None."""
    known = {key.removeprefix("answer."): value for key, value in arrays.items() if key.startswith("answer.")}
    if "solvable" not in known:
        return None
    known |= {"solvable": bool(known["solvable"]), "impulses": tuple(known.get("impulses", ()))}
    return Answer(**{**known, "sensitivity": float(known.get("sensitivity", Answer.sensitivity))})
