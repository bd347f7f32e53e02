"""FCLIB files, written data set by data set, of a problem with a known solution.

Two point masses with three degrees of freedom each rest on each other and on the ground. Contact 1 is between the
ground and the lower mass, contact 2 between the masses. All numbers are sums of few powers of two, so that every form
gives the same bits. At rest, M v = 0 = H r + f gives r.

With joints, a wall holds the lower mass along T1, and a bar ties both masses along T2: M v = 0 = H r + G λ + f gives f.
With rolling friction, two separate bodies with M = H = 1 are on the ground: the first slides along (3, 4) and rolls
about (−4, 3), the second sticks. A joint moves the last degree of freedom at −b, and w subtracts this from its row.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

M = np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
H = np.block([[np.eye(3), -np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
F = np.array([-2.0, 0.5, 0.0, -1.0, 0.0, 0.25])
W = H.T @ np.linalg.inv(M) @ H
Q = H.T @ np.linalg.inv(M) @ F
MU = np.array([0.25, 0.5])
IMPULSES = np.array([3.0, -0.5, -0.25, 1.0, 0.0, -0.25])

G = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, -1.0]])
JOINT_IMPULSES = np.array([0.5, -0.25])
F_JOINTED = -(H @ IMPULSES + G @ JOINT_IMPULSES)
V, R = H.T @ np.linalg.inv(M) @ G, G.T @ np.linalg.inv(M) @ G
Q_JOINTED, S = H.T @ np.linalg.inv(M) @ F_JOINTED, G.T @ np.linalg.inv(M) @ F_JOINTED

MU_ROLLING, MU_R = np.array([0.5, 0.5]), np.array([0.25, 0.125])
G_ROLLING, B = np.eye(10)[:, 9:], np.array([0.5])
ROLLING_IMPULSES = np.array([10.0, -3.0, -4.0, 2.0, -1.5, 2.0, 0.5, 0.0, 0.125, 0.0])
ROLLING_VELOCITY = np.array([0.0, 1.5, 2.0, -4.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
ROLLING_JOINT_IMPULSES = np.array([-0.25])
F_ROLLING = np.append(ROLLING_VELOCITY[:9], -B) - ROLLING_IMPULSES - G_ROLLING @ ROLLING_JOINT_IMPULSES
W_ROLLING = np.append(np.zeros(9), B)

Data = dict[str, Any]


def matrix_data(matrix: np.ndarray, kind: str) -> Data:
    """Return the data sets of a matrix, entry by entry in the order of the format's description."""
    rows, columns = matrix.shape
    if kind == "packed":
        return {**matrix_data(np.tril(matrix), "columns"), "symmetric_packed": 1}
    if kind == "triplets":
        found = [(i, j) for j in range(columns) for i in range(rows) if matrix[i, j]][::-1]  # in arbitrary order
        i, p, nz = [i for i, _ in found], [j for _, j in found], len(found)
        x = [matrix[at] for at in found]
    else:
        lines = matrix if kind == "rows" else matrix.T
        i = [k for line in lines for k in np.flatnonzero(line)]
        x = [value for line in lines for value in line[line != 0]]
        p = [0, *np.cumsum([np.count_nonzero(line) for line in lines])]
        nz = -2 if kind == "rows" else -1
    scalars = {"nzmax": len(x), "m": rows, "n": columns, "nz": nz}
    arrays = {name: np.array([number], dtype=np.int32) for name, number in scalars.items()}
    return {**arrays, "p": np.array(p, dtype=np.int32), "i": np.array(i, dtype=np.int32), "x": np.array(x)}


def local_data(kind: str = "rows", matrix: np.ndarray = W) -> Data:
    """Return the data sets of the local problem by their paths."""
    parts = {f"fclib_local/W/{name}": value for name, value in matrix_data(matrix, kind).items()}
    vectors = {"fclib_local/vectors/q": Q, "fclib_local/vectors/mu": MU}
    return {"fclib_local/spacedim": np.array([3], dtype=np.int32), **parts, **vectors}


def global_data(kind: str = "triplets") -> Data:
    """Return the data sets of the global problem by their paths."""
    parts = {
        f"fclib_global/{label}/{name}": value
        for label, matrix in (("M", M), ("H", H))
        for name, value in matrix_data(matrix, kind).items()
    }
    vectors = {f"fclib_global/vectors/{name}": value for name, value in {"f": F, "w": np.zeros(6), "mu": MU}.items()}
    return {"fclib_global/spacedim": np.array([3], dtype=np.int32), **parts, **vectors}


def jointed_data(kind: str = "rows") -> Data:
    """Return the data sets of the local problem with joints by their paths."""
    parts = {
        f"fclib_local/{label}/{name}": value
        for label, matrix in (("V", V), ("R", R))
        for name, value in matrix_data(matrix, "columns" if kind == "packed" else kind).items()
    }
    vectors = {"fclib_local/vectors/q": Q_JOINTED, "fclib_local/vectors/s": S}
    return {**local_data(kind), **parts, **vectors}


def global_jointed_data(kind: str = "triplets") -> Data:
    """Return the data sets of the global problem with joints by their paths."""
    parts = {f"fclib_global/G/{name}": value for name, value in matrix_data(G, kind).items()}
    vectors = {"fclib_global/vectors/f": F_JOINTED, "fclib_global/vectors/b": np.zeros(2)}
    return {**global_data(kind), **parts, **vectors}


def rolling_data(kind: str = "triplets") -> Data:
    """Return the data sets of the problem with rolling friction and a joint by their paths."""
    parts = {
        f"fclib_global_rolling/{label}/{name}": value
        for label, matrix in (("M", np.eye(10)), ("H", np.eye(10)), ("G", G_ROLLING))
        for name, value in matrix_data(matrix, kind).items()
    }
    vectors = {"f": F_ROLLING, "w": W_ROLLING, "b": B, "mu": MU_ROLLING, "mu_r": MU_R}
    named = {f"fclib_global_rolling/vectors/{name}": value for name, value in vectors.items()}
    return {"fclib_global_rolling/spacedim": np.array([5], dtype=np.int32), **parts, **named}


def write_data(path: Path, data: Data, **changes: Any) -> Path:
    """Write data sets into a new HDF5 file; a value of None omits one, ``symmetric_packed`` is an attribute."""
    with h5py.File(path, "w") as file:
        for name, value in {**data, **changes}.items():
            folder, _, last = name.rpartition("/")
            if value is None:
                continue
            if last == "symmetric_packed":
                file.require_group(folder).attrs[last] = value
            else:
                file[name] = value
    return path


def write_as_siconos(path: Path, form: str) -> Path:
    """Write the local or global problem with everything that files of Siconos in the public library contain.

    Matrices may state an nzmax beyond the length of their arrays, texts have a fixed length and may be empty, W has
    attributes that are not numbers, a guess has no v, and r and v of the solution are reserved and never written.
    """
    data = local_data("rows") if form == "local" else global_data("triplets")
    write_data(path, data)
    with h5py.File(path, "r+") as file:
        root = file[f"fclib_{form}"]
        for name, text in (("title", "Box_stacks"), ("description", "\nBox stacks\nh=0.01\n"), ("math_info", "")):
            root[f"info/{name}"] = np.bytes_(text or b"\0")
        if form == "local":
            root["info"].attrs["numberOfInvolvedDS"] = np.int32(2)
            root["W"].attrs.update({"cond": np.nan, "cond_lsmr": 14.6, "rank": np.int32(6), "symmetry": np.False_})
        else:
            for name in "MH":
                root[name]["nzmax"][...] = 2 * root[name]["nzmax"][:]
        file["guesses/number_of_guesses"] = np.array([1], dtype=np.int32)
        for group in ("guesses/1", "solution"):
            file[f"{group}/u"] = np.zeros(6)
        file["guesses/1/r"] = np.zeros(6)
        file["solution"].create_dataset("r", (6,), np.float64)
        for group in ("guesses/1", "solution") if form == "global" else ():
            file[group].create_dataset("v", (6,), np.float64)
    return path
