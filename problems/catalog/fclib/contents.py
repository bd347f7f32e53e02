"""What an FCLIB file holds, as arrays: a problem in one of its two forms, what is said of it, and a solution.

    /fclib_local     W, V, R    vectors q, s, mu            u = W r + V λ + q,   Vᵀ r + R λ + s = 0
    /fclib_global    M, H, G    vectors f, w, b, mu         M v = H r + G λ + f,   u = Hᵀ v + w,   Gᵀ v + b = 0
    /fclib_global_rolling       as global, with mu_r
    /solution        v, u, r, l
    /guesses         number_of_guesses

Source: Acary et al., *FCLIB: a collection of discrete 3D frictional contact problems*, Inria RT-444 (2014).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import FloatArray
from .container import ContainerError, Group
from .matrices import ROWS, TRIPLETS, read_matrix, stored_matrix

LOCAL, GLOBAL, ROLLING = "fclib_local", "fclib_global", "fclib_global_rolling"
"""Names of the roots."""

DIGEST = "proxbench_digest"
"""Text in files that were written here: the digest of the problem that must be read from them.

It stands twice, beside the title and beside the vectors, so that damage to one of its names is noticed.
"""

TEXTS = ("title", "description", "math_info")
"""What is said of a problem."""

MOST_GUESSES = 10_000
"""Guesses that a file may say it has."""


@dataclass(frozen=True, eq=False)
class Contents:
    """What both forms have.

    Attributes:
        dimension: rows of a contact, 2 or 3, the normal one first.
        friction: μ, shape (n_contacts,).
        bilateral: rows of V, R or G, which hold relative velocities at zero.
        rolling: whether there is rolling friction.
        about: texts by name: title, description, math_info.
        digest: that of the problem, in files that were written here; else empty.
        solution: the impulses r [N s] that are stored as the solution, shape (n_rows,), if any were written.
        guesses: how many guesses there are.
    """

    dimension: int
    friction: FloatArray
    bilateral: int = 0
    rolling: bool = False
    about: Mapping[str, str] = field(default_factory=dict)
    digest: str = ""
    solution: FloatArray | None = None
    guesses: int = 0


@dataclass(frozen=True, eq=False)
class LocalContents(Contents):
    """A problem by its Delassus matrix.

    Attributes:
        W: [1/kg], shape (n_rows, n_rows).
        q: [m/s], shape (n_rows,).
    """

    W: sp.csr_array[Any] = field(kw_only=True)
    q: FloatArray = field(kw_only=True)

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(self.q)


@dataclass(frozen=True, eq=False)
class GlobalContents(Contents):
    """A problem by its mass matrix and force directions.

    Attributes:
        M: mass matrix, shape (n_dofs, n_dofs).
        H: force directions, shape (n_dofs, n_rows).
        f: impulse of all other forces, with the momentum before, shape (n_dofs,).
        w: the part of the relative velocity that does not move with v [m/s], shape (n_rows,).
    """

    M: sp.csr_array[Any] = field(kw_only=True)
    H: sp.csc_array[Any] = field(kw_only=True)
    f: FloatArray = field(kw_only=True)
    w: FloatArray = field(kw_only=True)

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(self.w)


def read_contents(file: Group) -> LocalContents | GlobalContents:
    """Return what a file holds.

    Raises:
        ContainerError: if it holds no problem, several, or parts that do not belong together.
    """
    roots = [name for name in (LOCAL, GLOBAL, ROLLING) if name in file]
    if len(roots) != 1:
        what = "no problem" if not roots else "several problems"
        raise ContainerError(f"it holds {what}, and must have one of the groups {LOCAL}, {GLOBAL} and {ROLLING}")
    root = file.group(roots[0])
    vectors = root.group("vectors")
    common: dict[str, Any] = {
        "dimension": root.integer("spacedim"),
        "friction": vectors.floats("mu"),
        "rolling": roots[0] == ROLLING,
        "about": {name: root.group("info").text(name) for name in TEXTS} if "info" in root else {},
        "digest": _digest(root),
        "guesses": _guesses(file),
    }
    found: LocalContents | GlobalContents
    if roots[0] == LOCAL:
        q = vectors.floats("q")
        matrix = sp.csr_array(read_matrix(root.group("W"), (len(q), len(q))))
        common |= {"bilateral": _columns(root, "V", "R"), "solution": _solution(file, len(q))}
        found = LocalContents(W=matrix, q=q, **common)
    else:
        f, w = vectors.floats("f"), vectors.floats("w")
        mass = sp.csr_array(read_matrix(root.group("M"), (len(f), len(f))))
        directions = sp.csc_array(read_matrix(root.group("H"), (len(f), len(w))))
        common |= {"bilateral": _columns(root, "G"), "solution": _solution(file, len(w))}
        found = GlobalContents(M=mass, H=directions, f=f, w=w, **common)
    _check_contacts(found, root.path)
    return found


def stored_contents(contents: LocalContents | GlobalContents) -> dict[str, NDArray[Any] | bytes]:
    """Return the data sets of a file by their paths, without a solution; local matrices in rows, global in triplets."""
    vectors: dict[str, FloatArray]
    if isinstance(contents, LocalContents):
        root, matrices, vectors = LOCAL, {"W": stored_matrix(contents.W, ROWS)}, {"q": contents.q}
    else:
        mass, directions = (stored_matrix(matrix, TRIPLETS) for matrix in (contents.M, contents.H))
        root, matrices, vectors = GLOBAL, {"M": mass, "H": directions}, {"f": contents.f, "w": contents.w}
    data: dict[str, NDArray[Any] | bytes] = {f"{root}/spacedim": np.array([contents.dimension], dtype=np.int32)}
    data |= {f"{root}/{name}/{part}": array for name, parts in matrices.items() for part, array in parts.items()}
    data |= {f"{root}/vectors/{name}": vector for name, vector in {**vectors, "mu": contents.friction}.items()}
    data |= {f"{root}/info/{name}": text.encode() for name, text in contents.about.items() if text}
    digests = {f"{root}/{group}/{DIGEST}": contents.digest.encode() for group in ("info", "vectors")}
    return data | (digests if contents.digest else {})


def _digest(root: Group) -> str:
    groups = [root.group(name) for name in ("info", "vectors") if name in root]
    written = [group.text(DIGEST) for group in groups if DIGEST in group]
    if not written:
        return ""
    if len(written) != 2 or written[0] != written[1] or not written[0]:
        raise ContainerError(f"the two texts {DIGEST} in it are not the same")
    return written[0]


def _columns(root: Group, *names: str) -> int:
    """Return how many bilateral rows the matrices ``names`` stand for."""
    return max((root.group(name).integer("n") for name in names if name in root), default=0)


def _solution(file: Group, n_rows: int) -> FloatArray | None:
    """Return the impulses of the solution; None where they were never written, or are zeros that stand for that."""
    if "solution" not in file or not file.group("solution").is_written("r"):
        return None
    impulses = file.group("solution").floats("r")
    if impulses.shape != (n_rows,):
        raise ContainerError(f"/solution/r must have {n_rows} entries, and has {len(impulses)}")
    return impulses if impulses.any() else None


def _guesses(file: Group) -> int:
    if "guesses" not in file or "number_of_guesses" not in file.group("guesses"):
        return 0
    return min(max(file.group("guesses").integer("number_of_guesses"), 0), MOST_GUESSES)


def _check_contacts(contents: LocalContents | GlobalContents, path: str) -> None:
    contacts, dimension = len(contents.friction), contents.dimension
    if dimension in (2, 3) and contents.n_rows != dimension * contacts:
        raise ContainerError(
            f"{path} has {contents.n_rows} rows, and mu and spacedim mean {contacts} contacts of {dimension} rows each"
        )
