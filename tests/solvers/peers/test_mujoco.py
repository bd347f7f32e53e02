"""MuJoCo's constraint solvers solve the convex program of a contact problem, as stiff as their impedance makes it."""

import numpy as np
import pytest
from proxbench.bench.measure.contacts.variants import perturbed_copy
from proxbench.problems import ContactProblem, LawKind, Laws, Model, judge, load
from proxbench.solvers import SolverError, Status, Stop, create
from proxbench.solvers.peers.mujoco_constraints import Algorithm, MuJoCo

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

ALGORITHMS: tuple[Algorithm, ...] = ("Newton", "CG", "PGS")


def solved(problem: ContactProblem, algorithm: Algorithm, impedance: float) -> np.ndarray:
    prepared = MuJoCo(algorithm, impedance).prepare(problem)
    return prepared.solve(Stop(1e-8, max_iterations=2000, max_seconds=10.0)).impulses


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("name", ["funnel-30", "hard-sticking-box", "hard-stack-10"])
def test_harder_contacts_come_nearer_to_the_convex_model(name: str, algorithm: Algorithm) -> None:
    problem = load(name)
    if MuJoCo().supports(problem) is not None:
        pytest.skip("unsupported")
    soft, hard = (
        judge(problem, solved(problem, algorithm, impedance), Model.CONVEX).residual for impedance in (0.95, 0.999)
    )
    assert hard < 0.05 < 3.0 * soft


def test_compliance_is_the_residual_of_one_contact() -> None:
    """With R = (1 − d)/d G the impulse is d times that of a hard contact."""
    problem = ContactProblem.from_delassus([[0.25]], [-3.0], dim=1)
    for algorithm in ALGORITHMS:
        assert solved(problem, algorithm, 0.8) == pytest.approx([0.8 * 12.0])


def test_all_laws_find_their_rows() -> None:
    """Bilateral rows, bounded friction and planar and spatial contacts, in an order that is not MuJoCo's."""
    kinds = [
        LawKind.UNILATERAL,
        LawKind.SPATIAL_FRICTION,
        LawKind.PLANAR_FRICTION,
        LawKind.UNILATERAL,
        LawKind.BILATERAL,
        LawKind.UNILATERAL,
        LawKind.PLANAR_FRICTION,
    ]
    laws = Laws.in_order(
        kinds,
        np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.3]),
        np.array([0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0]),
        np.array([-1, 0, -1, -1, -1, -1, 5]),
    )
    c = np.array([-3.0, 0.2, -0.1, 5.0, -2.0, 4.0, -1.0, 9.0])
    problem = ContactProblem.from_delassus(np.eye(8), c, laws=laws)
    for algorithm in ALGORITHMS:
        found = solved(problem, algorithm, 0.999999)
        assert found[:6] == pytest.approx([3.0, -0.2, 0.1, -0.7, 2.0, -4.0], abs=1e-4)
        assert abs(found[7]) <= 0.3 * found[6] + 1e-9
        assert judge(problem, found, Model.CONVEX).residual < 1e-4


@pytest.mark.parametrize("algorithm", ["Newton", "CG"])  # PGS may stop before the solution, see docs/results-engines.md
def test_a_copy_in_other_units_with_permuted_contacts_is_solved_as_well(algorithm: Algorithm) -> None:
    copy = perturbed_copy(load("funnel-30"))
    assert judge(copy, solved(copy, algorithm, 0.999), Model.CONVEX).residual < 0.01


def test_a_residual_below_the_compliance_is_not_claimed() -> None:
    problem = load("funnel-30")
    solution = MuJoCo().prepare(problem).solve(Stop(1e-6, max_iterations=1000, max_seconds=10.0))
    assert solution.status == Status.STALLED
    assert "its own tolerance" in solution.message


def test_the_same_start_gives_the_same_bits() -> None:
    prepared = MuJoCo("CG", 0.999).prepare(load("funnel-30"))
    stop = Stop(1e-3, max_iterations=200, max_seconds=10.0)
    assert np.array_equal(prepared.solve(stop).impulses, prepared.solve(stop).impulses)


def test_rolling_friction_and_large_problems_are_refused() -> None:
    laws = Laws.contacts(0.5, 3, 1).with_rolling(0.01, 1)
    rolling = ContactProblem.from_delassus(np.eye(4), np.zeros(4), laws=laws)
    assert MuJoCo().supports(rolling) == (
        "MuJoCo has one bound for sliding and rolling friction, but this problem has two"
    )
    assert "dense matrices" in str(MuJoCo().supports(load("funnel-1000")))


def test_options_out_of_range_are_refused() -> None:
    with pytest.raises(SolverError, match="algorithm"):
        create("MuJoCo", algorithm="LU")
    with pytest.raises(SolverError, match="impedance"):
        create("MuJoCo(impedance=1.0)")
