"""Public FCLIB files, if PROXBENCH_FCLIB names a folder of them: read, judged, written, and read again.

Their residuals are compared with FCLIB's own merit function.
"""

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from fclib_merit import natural_map
from proxbench.problems import ContactProblem, judge, load, read_fclib, save_problem, write_fclib
from proxbench.solvers import solve

FOLDER = os.environ.get("PROXBENCH_FCLIB", "")
FILES = sorted(Path(FOLDER).glob("*.hdf5")) if FOLDER else []

pytestmark = pytest.mark.skipif(not FILES, reason="PROXBENCH_FCLIB names no folder of FCLIB files")


def matrix(group: h5py.Group) -> sp.csr_array:
    parts, shape = [group[name][:] for name in "xip"], (group["m"][0], group["n"][0])
    if group["nz"][0] >= 0:
        return sp.csr_array(sp.coo_array((parts[0], (parts[1], parts[2])), shape=shape))
    kind = {-1: sp.csc_array, -2: sp.csr_array}[int(group["nz"][0])]
    return sp.csr_array(kind(tuple(parts), shape=shape))


def velocities(path: Path, impulses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return u and the free velocity from the arrays of a file by the equations of FCLIB, and μ."""
    with h5py.File(path) as file:
        if "fclib_local" in file:
            root = file["fclib_local"]
            W, q = matrix(root["W"]), root["vectors/q"][:]
            return 0.5 * (W + W.T) @ impulses + q, q, root["vectors/mu"][:]
        root = file["fclib_global"]
        M, H = matrix(root["M"]), matrix(root["H"])
        f, w, mu = (root[f"vectors/{name}"][:] for name in ("f", "w", "mu"))
    free, v = (sp.linalg.spsolve(sp.csc_array(M), force) for force in (f, f + H @ impulses))
    return H.T @ v + w, H.T @ free + w, mu


@pytest.fixture(scope="module", params=FILES, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    found: Path = request.param
    return found


@pytest.fixture(scope="module")
def problem(path: Path) -> ContactProblem:
    return read_fclib(path)


def test_the_judge_and_the_merit_of_fclib_agree_on_the_answer_of_a_solver(path: Path, problem: ContactProblem) -> None:
    impulses = solve(problem, "NSGS", tolerance=1e-4, max_seconds=5.0).impulses
    for given in (impulses, np.zeros(problem.n_rows)):
        velocity, free, mu = velocities(path, given)
        merit, verdict = natural_map(velocity, given, mu), judge(problem, given)
        norms = [float(np.linalg.norm(vector)) for vector in (free, given, velocity)]
        assert abs(verdict.natural_map_max - merit / max(norms)) <= 1e-12
        assert abs(verdict.natural_map_q - merit / norms[0]) <= 1e-12 * max(norms) / norms[0]
    assert judge(problem, impulses).residual < judge(problem, np.zeros(problem.n_rows)).residual


def test_written_and_read_again_it_is_the_same_problem(path: Path, problem: ContactProblem, tmp_path: Path) -> None:
    save_problem(problem, tmp_path / "problem.npz")
    write_fclib(load(tmp_path / "problem.npz"), tmp_path / path.name)
    assert read_fclib(tmp_path / path.name).digest == problem.digest
    with h5py.File(path) as before, h5py.File(tmp_path / path.name) as after:
        for root, matrices, vectors in (("fclib_local", "W", ("q", "mu")), ("fclib_global", "MH", ("mu",))):
            for name in vectors if root in before else ():
                assert np.array_equal(before[f"{root}/vectors/{name}"], after[f"{root}/vectors/{name}"])
            for name in matrices if root in before and "asymmetry" not in problem.provenance else ():
                assert (matrix(before[f"{root}/{name}"]) != matrix(after[f"{root}/{name}"])).nnz == 0


def test_a_solution_is_read_only_if_the_file_has_one(path: Path, problem: ContactProblem) -> None:
    with h5py.File(path) as file:
        stored = "solution/r" in file and file["solution/r"][:].any()
    assert ("stored_solution_residual" in problem.provenance) == bool(stored)
    assert stored or problem.answer is None
