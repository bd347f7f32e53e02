"""The contents of an FCLIB file as arrays: a problem in one of two forms, its description, and a solution.

    /fclib_local     W, V, R    vectors q, s, mu            u = W r + V λ + q,   Vᵀ r + R λ + s = 0
    /fclib_global    M, H, G    vectors f, w, b, mu         M v = H r + G λ + f,   u = Hᵀ v + w,   Gᵀ v + b = 0
    /fclib_global_rolling       as global, with mu_r
    /solution        v, u, r, l
    /guesses         number_of_guesses

V, R and s, or G and b, exist if the problem has joints. A contact has ``spacedim`` rows: N and T, or N, T1 and
T2; with rolling friction N, T and R, or N, T1, T2, R1 and R2.

Sources: Acary et al., *FCLIB: a collection of discrete 3D frictional contact problems*, Inria RT-444 (2014); for
rolling friction, ``globalRollingFrictionContact_fclib_write`` of Siconos.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import FloatArray
from .container import ContainerError, Group
from .matrices import ROWS, TRIPLETS, read_matrix, stored_matrix

LOCAL, GLOBAL, ROLLING = "fclib_local", "fclib_global", "fclib_global_rolling"
"""Names of the root groups."""

DIGEST = "proxbench_digest"
"""Name of a text in files of ``write_fclib``: the digest of the problem.

It is stored twice, with the title and with the vectors, so that damage to one of the names is detected.
"""

TEXTS = ("title", "description", "math_info")
"""Names of the texts that describe a problem."""

ROWS_OF_CONTACTS = (2, 3, 5)
"""Possible numbers of rows of a contact; 5 requires rolling friction."""

MAX_GUESSES = 10_000
"""Largest number of guesses that is reported."""


@dataclass(frozen=True, eq=False)
class Contents:
    """The contents that local and global problems share.

    Attributes:
        dimension: rows of a contact, the normal one first: 2 or 3, with rolling friction 3 or 5.
        friction: μ, shape (n_contacts,).
        rolling_friction: μ_r [m], shape (n_contacts,); ``None`` without rolling friction.
        about: texts by name: title, description, math_info.
        digest: digest of the problem, in files of ``write_fclib``; else empty.
        solution: the impulses r and λ [N s] stored as the solution, shape (n_rows,); ``None`` if there are none.
        guesses: number of guesses.
    """

    dimension: int
    friction: FloatArray
    rolling_friction: FloatArray | None = None
    about: Mapping[str, str] = field(default_factory=dict)
    digest: str = ""
    solution: FloatArray | None = None
    guesses: int = 0


@dataclass(frozen=True, eq=False)
class LocalContents(Contents):
    """A problem given by its Delassus matrix.

    Attributes:
        W: block of the Delassus matrix between contacts [1/kg], shape (n_contact_rows, n_contact_rows).
        V: block between contacts and joints, shape (n_contact_rows, n_joints).
        R: block between joints, shape (n_joints, n_joints).
        q: free velocity of the contacts [m/s], shape (n_contact_rows,).
        s: free velocity of the joints [m/s or rad/s], shape (n_joints,).
    """

    W: sp.csr_array[Any] = field(kw_only=True)
    V: sp.csr_array[Any] = field(kw_only=True)
    R: sp.csr_array[Any] = field(kw_only=True)
    q: FloatArray = field(kw_only=True)
    s: FloatArray = field(kw_only=True)

    @property
    def n_contact_rows(self) -> int:
        """Number of rows of contacts."""
        return len(self.q)

    @property
    def n_joints(self) -> int:
        """Number of rows of joints."""
        return len(self.s)


@dataclass(frozen=True, eq=False)
class GlobalContents(Contents):
    """A problem given by its mass matrix and force directions.

    Attributes:
        M: mass matrix, shape (n_dofs, n_dofs).
        H: force directions of the contacts, shape (n_dofs, n_contact_rows).
        G: force directions of the joints, shape (n_dofs, n_joints).
        f: impulse of all other forces plus the momentum before the step, in the units of M v, shape (n_dofs,).
        w: the part of the contacts' relative velocity that does not depend on v [m/s], shape (n_contact_rows,).
        b: the same part for the joints [m/s or rad/s], shape (n_joints,).
    """

    M: sp.csr_array[Any] = field(kw_only=True)
    H: sp.csc_array[Any] = field(kw_only=True)
    G: sp.csc_array[Any] = field(kw_only=True)
    f: FloatArray = field(kw_only=True)
    w: FloatArray = field(kw_only=True)
    b: FloatArray = field(kw_only=True)

    @property
    def n_contact_rows(self) -> int:
        """Number of rows of contacts."""
        return len(self.w)

    @property
    def n_joints(self) -> int:
        """Number of rows of joints."""
        return len(self.b)


def read_contents(file: Group) -> LocalContents | GlobalContents:
    """Return the contents of a file.

    Raises:
        ContainerError: if the file contains no problem, several problems, or parts that do not match.
    """
    roots = [name for name in (LOCAL, GLOBAL, ROLLING) if name in file]
    if len(roots) != 1:
        problems = "no problem" if not roots else "several problems"
        raise ContainerError(f"it contains {problems}; it must have one of the groups {LOCAL}, {GLOBAL} and {ROLLING}")
    root = file.group(roots[0])
    vectors = root.group("vectors")
    common: dict[str, Any] = {
        "dimension": root.integer("spacedim"),
        "friction": vectors.floats("mu"),
        "rolling_friction": vectors.floats("mu_r") if roots[0] == ROLLING else None,
        "about": {name: root.group("info").text(name) for name in TEXTS} if "info" in root else {},
        "digest": _digest(root),
        "guesses": _guesses(file),
    }
    contents = (_local_contents if roots[0] == LOCAL else _global_contents)(root, vectors, common)
    _check_contacts(contents, root.path)
    return replace(contents, solution=_solution(file, contents.n_contact_rows, contents.n_joints))


def _local_contents(root: Group, vectors: Group, common: dict[str, Any]) -> LocalContents | GlobalContents:
    q, s = vectors.floats("q"), _free_joints(root, vectors, "s", ("V", "R"))
    coupling, joints = sp.csr_array((len(q), len(s))), sp.csr_array((len(s), len(s)))
    matrix = sp.csr_array(read_matrix(root.group("W"), (len(q), len(q))))
    if len(s):
        coupling = sp.csr_array(read_matrix(root.group("V"), coupling.shape))
        joints = sp.csr_array(read_matrix(root.group("R"), joints.shape))
    return LocalContents(W=matrix, V=coupling, R=joints, q=q, s=s, **common)


def _global_contents(root: Group, vectors: Group, common: dict[str, Any]) -> LocalContents | GlobalContents:
    f, w, b = vectors.floats("f"), vectors.floats("w"), _free_joints(root, vectors, "b", ("G",))
    mass = sp.csr_array(read_matrix(root.group("M"), (len(f), len(f))))
    directions = sp.csc_array(read_matrix(root.group("H"), (len(f), len(w))))
    joints = sp.csc_array((len(f), len(b)))
    if len(b):
        joints = sp.csc_array(read_matrix(root.group("G"), joints.shape))
    return GlobalContents(M=mass, H=directions, G=joints, f=f, w=w, b=b, **common)


def stored_contents(contents: LocalContents | GlobalContents) -> dict[str, NDArray[Any] | bytes]:
    """Return the data sets of a file by their paths, without a solution; local matrices in CSR, global in triplets."""
    vectors: dict[str, FloatArray] = {"mu": contents.friction}
    matrices: dict[str, Any]
    if isinstance(contents, LocalContents):
        root, kind, matrices, vectors["q"] = LOCAL, ROWS, {"W": contents.W}, contents.q
        if contents.n_joints:
            matrices |= {"V": contents.V, "R": contents.R}
            vectors["s"] = contents.s
    else:
        root, kind, matrices = GLOBAL, TRIPLETS, {"M": contents.M, "H": contents.H}
        vectors |= {"f": contents.f, "w": contents.w}
        if contents.n_joints:
            matrices["G"], vectors["b"] = contents.G, contents.b
        if contents.rolling_friction is not None:
            root, vectors["mu_r"] = ROLLING, contents.rolling_friction
    data: dict[str, NDArray[Any] | bytes] = {f"{root}/spacedim": np.array([contents.dimension], dtype=np.int32)}
    for name, matrix in matrices.items():
        data |= {f"{root}/{name}/{part}": array for part, array in stored_matrix(matrix, kind).items()}
    data |= {f"{root}/vectors/{name}": vector for name, vector in vectors.items()}
    data |= {f"{root}/info/{name}": text.encode() for name, text in contents.about.items() if text}
    digests = {f"{root}/{group}/{DIGEST}": contents.digest.encode() for group in ("info", "vectors")}
    return data | (digests if contents.digest else {})


def _digest(root: Group) -> str:
    groups = [root.group(name) for name in ("info", "vectors") if name in root]
    digests = [group.text(DIGEST) for group in groups if DIGEST in group]
    if not digests:
        return ""
    if len(digests) != 2 or digests[0] != digests[1] or not digests[0]:
        raise ContainerError(f"its two strings {DIGEST} differ")
    return digests[0]


def _free_joints(root: Group, vectors: Group, name: str, matrices: tuple[str, ...]) -> FloatArray:
    """Return the vector of the joints; an empty one if none of their matrices has columns."""
    if any(matrix in root and root.group(matrix).integer("n") for matrix in matrices):
        return vectors.floats(name)
    if vectors.is_written(name) and len(vectors.floats(name)):
        raise ContainerError(f"{vectors.path}/{name} needs {' and '.join(matrices)}, which the file lacks")
    return np.zeros(0)


def _solution(file: Group, n_contact_rows: int, n_joints: int) -> FloatArray | None:
    """Return r and λ of the solution; None if they were never written, or are all zero."""
    parts = [(name, count) for name, count in (("r", n_contact_rows), ("l", n_joints)) if count]
    if "solution" not in file or not all(file.group("solution").is_written(name) for name, _ in parts):
        return None
    impulses = [file.group("solution").floats(name) for name, _ in parts]
    for (name, count), vector in zip(parts, impulses, strict=True):
        if len(vector) != count:
            raise ContainerError(f"/solution/{name} must have {count} entries, got {len(vector)}")
    combined = np.concatenate([np.zeros(0), *impulses])
    return combined if combined.any() else None


def _guesses(file: Group) -> int:
    if "guesses" not in file or "number_of_guesses" not in file.group("guesses"):
        return 0
    return min(max(file.group("guesses").integer("number_of_guesses"), 0), MAX_GUESSES)


def _check_contacts(contents: LocalContents | GlobalContents, path: str) -> None:
    contacts, rolling = len(contents.friction), contents.rolling_friction
    if rolling is not None and len(rolling) != contacts:
        raise ContainerError(f"{path}/vectors/mu_r must have {contacts} entries, as mu has, got {len(rolling)}")
    if contents.dimension in ROWS_OF_CONTACTS and contents.n_contact_rows != contents.dimension * contacts:
        raise ContainerError(
            f"{path} has {contents.n_contact_rows} rows, but mu and spacedim imply {contacts} contacts of "
            f"{contents.dimension} rows each"
        )
