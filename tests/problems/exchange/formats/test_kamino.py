"""A dump of Kamino: the natural maps agree to single precision, and its answer is judged.

``files/kamino-stack.npz`` is a dump of Newton 1.8.0 on its CPU device: three boxes of mass ratio 1 : 10 : 100 on each
other and on the ground, twelve steps of 2 ms, with the ``natural_map`` of Kamino's metrics.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Model, ProblemError, judge, load, save_problem
from proxbench.problems.exchange.formats.kamino import problem_of_arrays
from proxbench.problems.exchange.repair import Repair
from proxbench.solvers import solve
from proxbench.solvers.peers.mujoco_program import unsupported_reason

DUMP = dict(np.load(Path(__file__).parent / "files" / "kamino-stack.npz"))
EXPECTED = float(DUMP.pop("natural_map"))


def natural_map(impulses: np.ndarray, velocity: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Return λ − P_K(λ − v − s) of contacts with rows N, T1, T2; s is De Saxcé's μ‖v_T‖ along N."""
    missed = []
    for impulse, moved, mu in zip(impulses.reshape(-1, 3), velocity.reshape(-1, 3), friction, strict=True):
        point = impulse - moved - np.array([mu * np.hypot(moved[1], moved[2]), 0.0, 0.0])
        normal, tangent = point[0], np.hypot(point[1], point[2])
        if mu * tangent <= -normal:
            image = np.zeros(3)
        elif tangent <= mu * normal:
            image = point
        else:
            length = (normal + mu * tangent) / (1.0 + mu * mu)
            image = np.append(length, mu * length * point[1:] / tangent)
        missed.append(impulse - image)
    return np.concatenate(missed)


def test_natural_map_of_kamino_agrees_to_single_precision() -> None:
    problem = problem_of_arrays(DUMP, Repair())
    assert (problem.n_contacts, problem.n_rows) == (12, 36)
    impulses = DUMP["lambdas"].astype(np.float64).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    missed = natural_map(impulses, problem.relative_velocity(impulses), DUMP["mu"])
    ours = np.abs(missed).max()
    rounding = np.finfo(np.float32).eps * float(np.abs(problem.delassus()).dot(np.abs(impulses)).max())
    assert abs(ours - EXPECTED) <= 10 * rounding
    assert rounding < 0.5 * EXPECTED  # otherwise the comparison is meaningless
    judged = judge(problem, impulses).natural_map_q * np.linalg.norm(problem.free_velocity)
    assert judged == pytest.approx(np.linalg.norm(missed), rel=1e-9)


def test_stored_solution_of_kamino_is_judged_and_solve_improves_it() -> None:
    problem = problem_of_arrays(DUMP, Repair(indefinite="project"))
    stored = problem.provenance["stored_solution_residual"]
    solution = solve(problem, tolerance=1e-8)
    assert isinstance(stored, float)
    assert 1e-8 < stored < 1e-3
    assert judge(problem, solution.impulses).residual <= 1e-8


def test_import_removes_the_preconditioner() -> None:
    scaled = problem_of_arrays(DUMP, Repair())
    diagonal = DUMP["D"].diagonal() / DUMP["P"].astype(np.float64) ** 2
    order = np.arange(36).reshape(-1, 3)[:, [2, 0, 1]].ravel()
    np.testing.assert_allclose(scaled.delassus().diagonal(), diagonal[order], rtol=1e-6)
    assert not np.allclose(DUMP["P"], 1.0)


def test_joints_and_limits_stand_before_the_contacts() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6)).astype(np.float32)
    G = root @ root.T
    arrays = {"D": G, "v_f": np.ones(6), "mu": np.array([0.3]), "njc": np.array(2), "nl": np.array(1)}
    problem = problem_of_arrays(arrays, Repair())
    assert problem.laws.kind.tolist() == [3, 3, 0, 0, 2]
    order = [0, 1, 2, 5, 3, 4]
    np.testing.assert_allclose(problem.delassus().toarray(), G[order][:, order], rtol=1e-6)


def test_bounded_multipliers_are_friction_with_bounds_in_physical_units() -> None:
    """The impulse b slows down a slider of mass m that moves at v < 0, and stops it if b suffices."""
    mass, scale = np.array([2.0, 0.5]), np.array([0.25, 4.0])
    bound = np.array([1.0, 3.0])
    arrays = {
        "D": np.diag(scale**2 / mass),
        "P": scale,
        "v_f": scale * np.array([-1.0, -2.0]),
        "mu": np.zeros(0),
        "nbc": np.array(2),
        "bound_lower": -bound / scale,
        "bound_upper": bound / scale,
    }
    problem = problem_of_arrays(arrays, Repair())
    assert problem.laws.kind.tolist() == [1, 1]
    assert solve(problem).impulses == pytest.approx([1.0, 1.0])
    assert problem.relative_velocity(solve(problem).impulses) == pytest.approx([-0.5, 0.0], abs=1e-7)
    for name, value in (("bound_lower", -2.0 * bound), ("bound_upper", np.array([np.inf, 1.0]))):
        with pytest.raises(ProblemError, match="equal in both directions"):
            problem_of_arrays(arrays | {name: value}, Repair())
    with pytest.raises(ProblemError, match="'bound_lower' must have 2 numbers"):
        problem_of_arrays({name: value for name, value in arrays.items() if name != "bound_lower"}, Repair())


def compliant_dump(with_answer: bool = True) -> dict[str, Any]:
    """Return the dump of a joint, a limit and two contacts, one without friction, with Kamino's own model."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(8, 8))
    G, c = root @ root.T + np.eye(8), rng.normal(size=8)
    c[[4, 7]] -= 2.0
    scale, compliance = rng.uniform(0.5, 2.0, 8), np.array([0.0, 0.5, 0.0, 0.0, 2.0, 0.0, 0.0, 0.25])
    order = np.array([0, 1, 4, 2, 3, 7, 5, 6])
    laws = Laws.concatenate([Laws.joints(1), Laws.contacts(0.0, 1, 1), Laws.contacts([0.5, 0.0], 3, 2)])
    D = G + np.diag(compliance)
    soft = ContactProblem.from_delassus(D[order][:, order], c[order], laws=laws)
    answer = np.zeros(8)
    answer[order] = solve(soft, tolerance=1e-10).impulses
    arrays = {
        "D": scale[:, None] * D * scale,
        "P": scale,
        "v_f": scale * c,
        "mu": np.array([0.5, 0.0]),
        "njc": np.array(1),
        "nl": np.array(1),
        "compliance": compliance,
    }
    return arrays | ({"lambdas": answer, "v_plus": D @ answer + c} if with_answer else {})


def test_a_compliant_dump_is_the_hard_problem_with_kaminos_own_model() -> None:
    """A solution of Coulomb's law on G + R solves Kamino's own model, but not the problem of hard contacts."""
    dump = compliant_dump()
    problem = problem_of_arrays(dump, Repair())
    order = [0, 1, 4, 2, 3, 7, 5, 6]
    hard = dump["D"] / np.outer(dump["P"], dump["P"]) - np.diag(dump["compliance"])
    np.testing.assert_allclose(problem.delassus().toarray(), hard[order][:, order], rtol=1e-6, atol=1e-6)
    impulses = dump["lambdas"][order]
    assert impulses[[1, 2]].min() > 0.0
    assert judge(problem, impulses, Model.ENGINE).residual <= 1e-5
    assert judge(problem, impulses).residual > 0.05
    assert judge(problem, 1.1 * impulses, Model.ENGINE).residual > 0.05
    assert problem.provenance["stored_solution_own_residual"] <= 1e-5
    assert problem.provenance["largest_compliance"] == 2.0
    solution = solve(problem, tolerance=1e-10).impulses
    assert judge(problem, solution).residual <= 1e-10
    assert judge(problem, solution, Model.ENGINE).residual > 0.05


def test_a_single_compliant_contact_has_the_known_impulse() -> None:
    """A mass m on a spring-damper of compliance R stops at Λ = −c / (1/m + R), and slides at μ Λ."""
    arrays = {
        "D": np.diag([0.5, 0.5, 0.5 + 1.5]),
        "v_f": np.array([3.0, 0.0, -2.0]),
        "mu": np.array([0.5]),
        "compliance": np.array([0.0, 0.0, 1.5]),
        "lambdas": np.array([-0.5, 0.0, 1.0]),
        "v_plus": np.array([2.75, 0.0, 0.0]),
    }
    problem = problem_of_arrays(arrays, Repair())
    assert problem.provenance["stored_solution_own_residual"] <= 1e-7
    assert problem.relative_velocity(np.array([1.0, -0.5, 0.0])) == pytest.approx([-1.5, 2.75, 0.0])
    assert solve(problem).impulses == pytest.approx([4.0, -2.0, 0.0])


def test_a_compliance_of_zeros_changes_nothing(tmp_path: Path) -> None:
    plain = problem_of_arrays(DUMP, Repair())
    assert problem_of_arrays(DUMP | {"compliance": np.zeros(36)}, Repair()).digest == plain.digest
    assert plain.engine is None
    np.savez(tmp_path / "soft.npz", **compliant_dump())
    problem = load(tmp_path / "soft.npz")
    assert "follows Coulomb's law" in str(unsupported_reason(problem))
    save_problem(problem, tmp_path / "again.npz")
    assert load(tmp_path / "again.npz").digest == problem.digest


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"D": None}, "there is no array 'D'"),
        ({"nbc": np.array(2)}, "must have 38 numbers|must have 1444 numbers"),
        ({"nc": np.array([12, 12])}, "'nc' must be one whole number; dump one world at a time"),
        ({"nc": np.array(13)}, "must have 1521 numbers|must have 39 numbers"),
        ({"P": -DUMP["P"]}, "'P', the preconditioner, must be positive"),
        ({"D": DUMP["D"] + np.eye(36, dtype=np.float32)}, "differs from v_plus by .*; dump D before the solve"),
        ({"lambdas": DUMP["lambdas"] * np.nan}, "'impulses' must be 36 finite numbers"),
        ({"compliance": np.full(36, -0.5)}, "'compliance' must not be negative"),
        ({"compliance": np.full(36, 1e6)}, "'compliance' exceeds the diagonal of D, which contains it"),
        ({"compliance": np.full(35, 0.0)}, "'compliance' must have 36 numbers"),
    ],
)
def test_inconsistent_input_gets_one_sentence(changes: dict[str, Any], words: str) -> None:
    arrays = {name: value for name, value in (DUMP | changes).items() if value is not None}
    with pytest.raises(ProblemError, match=words):
        problem_of_arrays(arrays, Repair())
