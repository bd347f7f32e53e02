"""Joints and rolling friction in FCLIB files: known answers, FCLIB's equations, unchanged bits, clear errors."""

from pathlib import Path

import h5py
import handmade_fclib as made
import numpy as np
import pytest
import scipy.sparse as sp
from fclib_merit import natural_map
from handmade_fclib import Data, global_jointed_data, jointed_data, matrix_data, rolling_data, write_data
from proxbench.problems import ContactProblem, ProblemError, judge, load, read_fclib, save_problem, write_fclib
from proxbench.problems.contact.laws import LawKind
from proxbench.problems.exchange.fclib.contents import DIGEST
from proxbench.problems.hard import hard_case
from proxbench.problems.hard.families import LinkedFamily, random_linked_problem
from proxbench.solvers import solve

JOINTED = np.append(made.IMPULSES, made.JOINT_IMPULSES)
ROLLING = np.append(made.ROLLING_IMPULSES, made.ROLLING_JOINT_IMPULSES)
SHIPPED = Path(__file__).parent / "files"


@pytest.mark.parametrize("kind", ["rows", "columns", "triplets", "packed"])
def test_a_local_problem_with_joints_has_the_known_solution_in_every_storage(kind: str, tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", jointed_data(kind)))
    assert problem.laws.kind.tolist() == [0, 2, 0, 2, 3, 3]
    assert judge(problem, JOINTED).residual == 0.0
    whole = np.block([[made.W, made.V], [made.V.T, made.R]])
    assert np.array_equal(problem.delassus().toarray(), whole)
    assert np.array_equal(problem.free_velocity, np.append(made.Q_JOINTED, made.S))


@pytest.mark.parametrize("kind", ["rows", "columns", "triplets"])
def test_a_global_problem_with_joints_has_the_known_solution_in_every_storage(kind: str, tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", global_jointed_data(kind)))
    assert problem.laws.kind.tolist() == [0, 2, 0, 2, 3, 3]
    assert judge(problem, JOINTED).residual == 0.0
    assert problem.factors is not None
    assert np.array_equal(problem.factors.force_directions.toarray(), np.hstack([made.H, made.G]))


@pytest.mark.parametrize("kind", ["rows", "columns", "triplets"])
def test_a_contact_that_slides_and_rolls_has_the_known_solution_in_every_storage(kind: str, tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", rolling_data(kind)))
    assert problem.laws.kind.tolist() == [0, 2, 5, 0, 2, 5, 3]
    assert problem.laws.friction_coefficient.tolist() == [0.0, 0.5, 0.25, 0.0, 0.5, 0.125, 0.0]
    assert judge(problem, ROLLING).residual <= 1e-15
    assert np.array_equal(problem.relative_velocity(ROLLING), np.append(made.ROLLING_VELOCITY, 0.0))
    found = solve(problem, "NSGS", tolerance=1e-12).impulses
    assert problem.relative_velocity(found)[:10] == pytest.approx(made.ROLLING_VELOCITY, abs=1e-10)


def test_a_planar_contact_with_rolling_friction_has_three_rows(tmp_path: Path) -> None:
    """Λ_N = 2; the body slides at 3 m/s less μ Λ_N, and rolls at 1 rad/s less μ_r Λ_N."""
    identity = {
        f"fclib_global_rolling/{label}/{name}": value
        for label in "MH"
        for name, value in matrix_data(np.eye(3), "columns").items()
    }
    vectors = {"f": np.zeros(3), "w": np.array([-2.0, 3.0, 1.0]), "mu": np.array([0.5]), "mu_r": np.array([0.25])}
    data = identity | {f"fclib_global_rolling/vectors/{name}": value for name, value in vectors.items()}
    path = write_data(tmp_path / "p.hdf5", {"fclib_global_rolling/spacedim": np.array([3]), **data})
    problem = read_fclib(path)
    assert problem.laws.kind.tolist() == [LawKind.UNILATERAL, LawKind.PLANAR_FRICTION, LawKind.PLANAR_ROLLING]
    assert judge(problem, np.array([2.0, -1.0, -0.5])).residual < 1e-15  # zero up to rounding
    write_fclib(problem, tmp_path / "again.hdf5")
    assert read_fclib(tmp_path / "again.hdf5").digest == problem.digest


def body_inertias(rng: np.random.Generator) -> np.ndarray:
    """Return a mass matrix of blocks of 6, 1, 1 and 1 degrees of freedom."""
    half = rng.normal(size=(6, 6))
    mass = np.zeros((9, 9))
    mass[:6, :6], mass[6:, 6:] = half @ half.T + np.eye(6), np.diag(rng.uniform(1.0, 2.0, 3))
    return mass


def random_global(rng: np.random.Generator, rolling: bool) -> Data:
    """Return the data sets of two contacts and two joints with random numbers, as a global problem.

    w and b are small, so that c minus the part due to f keeps all bits, and f can be written.
    """
    root, rows = ("fclib_global_rolling", 5) if rolling else ("fclib_global", 3)
    matrices = {"M": body_inertias(rng), "H": rng.normal(size=(9, 2 * rows)), "G": rng.normal(size=(9, 2))}
    vectors = {"f": rng.normal(size=9), "w": 0.01 * rng.normal(size=2 * rows), "b": 0.01 * rng.normal(size=2)}
    vectors |= {name: rng.uniform(size=2) for name in (["mu", "mu_r"] if rolling else ["mu"])}
    parts = {
        f"{root}/{label}/{name}": value
        for (label, matrix), kind in zip(matrices.items(), ("columns", "rows", "triplets"), strict=True)
        for name, value in matrix_data(matrix, kind).items()
    }
    dense = {f"dense/{label}": matrix for label, matrix in matrices.items()}
    named = {f"{root}/vectors/{name}": vector for name, vector in vectors.items()}
    return {f"{root}/spacedim": np.array([rows]), **parts, **named, **dense}


def random_local(rng: np.random.Generator) -> Data:
    """Return the data sets of two contacts and two joints with random numbers, as a local problem."""
    half = rng.normal(size=(9, 8))
    whole = half.T @ half
    matrices = {"W": whole[:6, :6], "V": whole[:6, 6:], "R": whole[6:, 6:]}
    vectors = {"q": rng.normal(size=6), "s": rng.normal(size=2), "mu": rng.uniform(size=2)}
    parts = {
        f"fclib_local/{label}/{name}": value
        for label, matrix in matrices.items()
        for name, value in matrix_data(matrix, "columns").items()
    }
    dense = {f"dense/{label}": matrix for label, matrix in matrices.items()}
    named = {f"fclib_local/vectors/{name}": vector for name, vector in vectors.items()}
    return {"fclib_local/spacedim": np.array([3]), **parts, **named, **dense}


def by_the_equations(data: Data, r: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return u and the residuals of the joints, from FCLIB's equations with the symbols of its files."""
    given = {name.rpartition("/")[2]: value for name, value in data.items() if "/vectors/" in name or "dense/" in name}
    if "W" in given:
        W, V, R = given["W"], given["V"], given["R"]
        return W @ r + V @ joints + given["q"], V.T @ r + R @ joints + given["s"]
    v = np.linalg.solve(given["M"], given["H"] @ r + given["G"] @ joints + given["f"])
    return given["H"].T @ v + given["w"], given["G"].T @ v + given["b"]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("form", ["local", "global", "rolling"])
def test_the_natural_map_of_the_judge_is_that_of_fclibs_equations(form: str, seed: int, tmp_path: Path) -> None:
    """It is the projection onto the cone for contacts, and the residual of their equation for joints."""
    rng = np.random.default_rng(seed)
    data = random_local(rng) if form == "local" else random_global(rng, form == "rolling")
    problem = read_fclib(write_data(tmp_path / "p.hdf5", data))
    impulses = rng.normal(size=problem.n_rows)
    u, missed = by_the_equations(data, impulses[:-2], impulses[-2:])
    free, missed_freely = by_the_equations(data, np.zeros(problem.n_rows - 2), np.zeros(2))
    friction = [value for name, value in data.items() if name.rpartition("/")[2] in ("mu", "mu_r")]
    of_contacts, of_joints = natural_map(u, impulses[:-2], *friction), np.linalg.norm(missed)
    merit, verdict, c = np.hypot(of_contacts, of_joints), judge(problem, impulses), np.append(free, missed_freely)
    assert min(of_contacts, of_joints) > 1e-3
    assert verdict.natural_map_q == pytest.approx(merit / np.linalg.norm(c), rel=1e-12)
    largest = max(np.linalg.norm(vector) for vector in (c, impulses, np.append(u, missed)))
    assert verdict.natural_map_max == pytest.approx(merit / largest, rel=1e-12)


def stored_matrix(group: h5py.Group) -> np.ndarray:
    x, i, p, shape = group["x"][:], group["i"][:], group["p"][:], (group["m"][0], group["n"][0])
    kinds = {-1: sp.csc_array, -2: sp.csr_array}
    nz = int(group["nz"][0])
    return (kinds[nz]((x, i, p), shape=shape) if nz < 0 else sp.coo_array((x, (i, p)), shape=shape)).toarray()


@pytest.mark.parametrize("form", ["local", "global", "rolling"])
def test_a_file_written_again_by_way_of_a_problem_file_has_every_bit(form: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    data = random_local(rng) if form == "local" else random_global(rng, form == "rolling")
    first = read_fclib(write_data(tmp_path / "first.hdf5", data))
    save_problem(first, tmp_path / "problem.npz")
    write_fclib(load(tmp_path / "problem.npz"), tmp_path / "second.hdf5")
    assert read_fclib(tmp_path / "second.hdf5").digest == first.digest
    with h5py.File(tmp_path / "second.hdf5") as file:
        (root,) = file.values()
        for label, matrix in [(name[6:], value) for name, value in data.items() if name.startswith("dense/")]:
            assert np.array_equal(stored_matrix(root[label]), matrix), label
        for name in root["vectors"].keys() - {DIGEST}:
            wanted = data[f"{root.name[1:]}/vectors/{name}"]
            is_exact = name in ("mu", "mu_r", "q", "s")
            assert np.abs(root[f"vectors/{name}"] - wanted).max() <= (0.0 if is_exact else 1e-13), name
        assert bytes(root[f"info/{DIGEST}"][()]).decode() == first.digest


@pytest.mark.parametrize(
    ("data", "impulses", "n_joints"),
    [(jointed_data(), JOINTED, 2), (global_jointed_data(), JOINTED, 2), (rolling_data(), ROLLING, 1)],
    ids=["local", "global", "rolling"],
)
def test_a_solution_is_stored_with_the_impulses_of_joints_and_confirmed(
    data: Data, impulses: np.ndarray, n_joints: int, tmp_path: Path
) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", data))
    write_fclib(problem, tmp_path / "solved.hdf5", impulses)
    again = read_fclib(tmp_path / "solved.hdf5")
    assert again.answer is not None
    assert np.array_equal(again.answer.witness, impulses)  # type: ignore[arg-type]
    with h5py.File(tmp_path / "solved.hdf5", "a") as file:
        assert np.array_equal(file["solution/l"], impulses[-n_joints:])
        assert np.array_equal(file["solution/r"], impulses[:-n_joints])
        assert np.array_equal(file["solution/u"], problem.relative_velocity(impulses)[:-n_joints])
        if "solution/v" in file:
            assert problem.factors is not None
            moved = problem.factors.force_directions.T @ file["solution/v"][:]
            free = problem.free_velocity - problem.factors.force_directions.T @ problem.factors.free_motion
            assert moved + free == pytest.approx(problem.relative_velocity(impulses), abs=1e-13)
        del file["solution/l"]
    assert read_fclib(tmp_path / "solved.hdf5").answer is None  # λ was never written


@pytest.mark.parametrize("name", ["hard-towed-wheel-rolls", "hard-towed-wheel-slides"])
def test_joints_and_their_impulses_are_reordered_behind_contacts(name: str, tmp_path: Path) -> None:
    problem = hard_case(name)
    assert problem.answer is not None
    (known,) = problem.answer.impulses
    write_fclib(problem, tmp_path / "p.hdf5", known)
    again = read_fclib(tmp_path / "p.hdf5")
    order = [*range(10, 13), *range(10)]  # ten joints, and the wheel with N, T, R
    assert np.array_equal(again.free_velocity, problem.free_velocity[order])
    assert np.array_equal(again.delassus().toarray(), problem.delassus().toarray()[np.ix_(order, order)])
    assert again.answer is not None
    assert np.array_equal(again.answer.witness, known[order])  # type: ignore[arg-type]


def test_joints_without_contacts_are_a_problem(tmp_path: Path) -> None:
    problem = hard_case("hard-four-bar-redundant")
    for form in (problem, ContactProblem(problem.free_velocity, problem.laws, matrix=problem.delassus())):
        write_fclib(form, tmp_path / "p.hdf5")
        again = read_fclib(tmp_path / "p.hdf5")
        assert (again.digest, again.laws.kind.tolist()) == (form.digest, [LawKind.BILATERAL] * 12)


@pytest.mark.parametrize("rolling_rows", [0, 2])
def test_a_problem_of_ours_with_both_laws_comes_back_with_the_same_digest(rolling_rows: int, tmp_path: Path) -> None:
    problem = random_linked_problem(LinkedFamily(5, 3, n_dofs=20, mass_exponent=4, rolling_rows=rolling_rows), 3)
    write_fclib(problem, tmp_path / "p.hdf5")
    assert read_fclib(tmp_path / "p.hdf5").digest == problem.digest


def test_an_exported_file_of_an_earlier_version_is_read() -> None:
    problem = read_fclib(SHIPPED / "joint-and-rolling.hdf5")  # reading compares the digest
    assert judge(problem, ROLLING).residual <= 1e-15
    assert problem.answer is not None


def test_matrices_without_columns_are_no_joints(tmp_path: Path) -> None:
    none = {"fclib_global/G/n": np.array([0])}
    problem = read_fclib(write_data(tmp_path / "p.hdf5", made.global_data(), **none))
    assert not problem.laws.is_bilateral.any()


def without(data: Data, group: str) -> Data:
    return {name: value for name, value in data.items() if not name.startswith(group)}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (without(jointed_data(), "fclib_local/vectors/s"), "fclib_local/vectors/s is missing"),
        (without(jointed_data(), "fclib_local/R"), "fclib_local/R is missing"),
        (without(jointed_data(), "fclib_local/V"), "fclib_local/V is missing"),
        (without(without(jointed_data(), "fclib_local/V"), "fclib_local/R"), "s needs V and R, which the file lacks"),
        (without(rolling_data(), "fclib_global_rolling/G"), "b needs G, which the file lacks"),
        (without(rolling_data(), "fclib_global_rolling/vectors/b"), "fclib_global_rolling/vectors/b is missing"),
        (without(rolling_data(), "fclib_global_rolling/vectors/mu_r"), "vectors/mu_r is missing"),
        (jointed_data() | {"fclib_local/vectors/s": np.zeros(3)}, r"V must have shape \(6, 3\)"),
        (jointed_data() | {"fclib_local/vectors/s": np.full(2, np.nan)}, r"c\[6\] = nan must be finite"),
        (jointed_data() | {"solution/r": np.zeros(6), "solution/l": np.ones(3)}, "solution/l must have 2 entries"),
        (rolling_data() | {"fclib_global_rolling/vectors/mu_r": np.ones(3)}, "mu_r must have 2 entries, as mu has"),
        (rolling_data() | {"fclib_global_rolling/vectors/mu_r": np.array([0.1, -0.1])}, r"mu_r\[1\] = -0.1 must be"),
        (rolling_data() | {"fclib_global_rolling/spacedim": np.array([3])}, "imply 2 contacts of 3 rows each"),
        (rolling_data() | {"fclib_global_rolling/spacedim": np.array([4])}, "spacedim = 4 must be 3 or 5"),
        (made.local_data() | {"fclib_local/spacedim": np.array([5])}, "imply 2 contacts of 5 rows each"),
    ],
)
def test_inconsistent_parts_are_refused_in_one_sentence(data: Data, words: str, tmp_path: Path) -> None:
    path = write_data(tmp_path / "p.hdf5", data)
    with pytest.raises(ProblemError, match=words) as caught:
        load(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_rolling_friction_without_factors_is_refused(tmp_path: Path) -> None:
    problem = random_linked_problem(LinkedFamily(2, 3, n_dofs=9), 0)
    assembled = ContactProblem(problem.free_velocity, problem.laws, matrix=problem.delassus())
    with pytest.raises(ProblemError, match="rolling friction only in global problems; create the problem from"):
        write_fclib(assembled, tmp_path / "p.hdf5")
    assert list(tmp_path.iterdir()) == []


def crooked(label: str) -> Data:
    """Return a local problem with joints in which one entry of W or R is too large by 1e-3 of the largest one."""
    data = random_local(np.random.default_rng(8))
    matrix = data[f"dense/{label}"].copy()
    matrix[0, -1] += 1e-3 * np.abs(matrix).max()
    return data | {f"fclib_local/{label}/{name}": value for name, value in matrix_data(matrix, "columns").items()}


@pytest.mark.parametrize("label", ["W", "R"])
def test_an_asymmetry_between_contacts_or_between_joints_is_named_and_taken_out_or_kept(
    label: str, tmp_path: Path
) -> None:
    path = write_data(tmp_path / "p.hdf5", crooked(label))
    problem = read_fclib(path)
    assert abs(problem.delassus() - problem.delassus().T).max() == 0.0
    assert str(problem.provenance["matrix"]).startswith(f"{label} is asymmetric by 1.0e-03")
    kept = read_fclib(path, "keep")
    write_fclib(kept, tmp_path / "again.hdf5")
    assert read_fclib(tmp_path / "again.hdf5", "keep").digest == kept.digest


def test_an_asymmetry_between_contacts_and_joints_is_not_written(tmp_path: Path) -> None:
    problem = read_fclib(write_data(tmp_path / "p.hdf5", jointed_data()))
    matrix = problem.delassus().toarray()
    matrix[1, 6] += 0.125
    bent = ContactProblem(problem.free_velocity, problem.laws, matrix=sp.csr_array(matrix), allow_asymmetric=True)
    with pytest.raises(ProblemError, match="not symmetric between contacts and joints"):
        write_fclib(bent, tmp_path / "again.hdf5")
