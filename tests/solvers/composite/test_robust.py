"""Robust: sweeps solve easy problems, other methods the rest, and the message lists the parts."""

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import scipy.linalg  # noqa: F401  # so that its BLAS is loaded
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import Status, Stop, create, solve
from proxbench.solvers.composite import robust, sweep_selection
from proxbench.solvers.composite.robust import PreparedRobust
from proxbench.solvers.composite.sweep_selection import can_accelerate, select_sweeps, sweeps_between_checks
from proxbench.solvers.composite.windows import WINDOW
from proxbench.solvers.iteration.loop import iterate
from proxbench.solvers.iteration.stopping import MAX_CHECK_INTERVAL
from threadpoolctl import threadpool_info, threadpool_limits


@pytest.mark.parametrize("name", ["funnel-30", "funnel-100-late", "hard-sticking-box", "woodpecker-upper-impact"])
def test_flows_are_solved_by_sweeps_alone_with_the_same_bits(name: str) -> None:
    """No other method is prepared, and the impulses are those of as many sweeps to the last bit.

    On few rows, where a check of the residual takes longer than a sweep, it is checked at different sweeps.
    """
    problem = load(name)
    solution, sweeps = solve(problem, tolerance=1e-8), select_sweeps(problem)
    assert solution.status is Status.SOLVED
    assert solution.message == f"{sweeps.name}: solved"
    as_many = solve(problem, sweeps, tolerance=1e-300, max_iterations=solution.iterations)
    assert solution.impulses.tobytes() == as_many.impulses.tobytes()
    difference = solution.iterations - solve(problem, sweeps, tolerance=1e-8).iterations
    assert abs(difference) <= (0 if sweeps_between_checks(problem, sweeps) == 1 else MAX_CHECK_INTERVAL)


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("hard-stack-10-top-heavy", "Newton steps"),
        ("hard-tower-10-top-1e4", "Newton steps"),
        ("funnel-30-late", "InteriorPoint"),
        ("hard-stack-100-alternating-1e4", "Newton steps"),
        ("hard-stack-2-top-1e8", "Newton steps"),
        ("bodies-stack-10-top-1e6", "ClarabelCoulomb(form='factors')"),
    ],
)
def test_the_message_ends_with_the_part_that_solves_the_problem(name: str, part: str) -> None:
    problem = load(name)
    solution = solve(problem, tolerance=1e-8, max_iterations=10**6)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8
    assert solution.message.endswith(f"{part}: solved")
    assert ": slow; " in solution.message


@pytest.mark.parametrize("name", ["hard-chain-100", "hard-chain-100-pulled"])
def test_with_joints_newton_steps_follow_a_short_window_of_sweeps(name: str) -> None:
    """An impulse passes one joint per sweep, so a hundred joints would take several windows."""
    problem = load(name)
    solution = solve(problem, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert solution.message.endswith("; Newton steps: solved")
    assert solution.iterations < WINDOW


def test_sweeps_continue_after_useless_newton_steps() -> None:
    """On few rows Newton steps are tried after a hundred slow sweeps; here sweeps find the solution later."""
    problem = load("hard-random-frictionless-masses")
    solution = solve(problem, tolerance=1e-8, max_iterations=10**6)
    assert solution.status is Status.SOLVED
    assert solution.message.count(f"{select_sweeps(problem).name}: ") == 2


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("hard-random-sparse-300", 1e-8), pytest.param("pile-1000", 1e-4, marks=pytest.mark.slow)],
)
def test_accelerated_sweeps_continue_from_the_best_impulses_of_slow_sweeps(
    name: str, tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sweeps have no momentum, so they are slow."""
    monkeypatch.setattr(sweep_selection, "FAST_MOMENTUM", 0.0)
    problem = load(name)
    solution = solve(problem, tolerance=tolerance, max_iterations=10**6)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= tolerance
    assert solution.message == f"{select_sweeps(problem).name}: slow; AndersonSORprox: solved"


def test_diverging_sweeps_are_not_resumed() -> None:
    """Sweeps diverge in the first window; accelerated sweeps start from the best impulses, then other parts follow."""
    problem = load("funnel-30-late")

    def growing(start: np.ndarray) -> Iterator[np.ndarray]:
        while True:
            start = 10.0 * start + 1.0
            yield start

    prepared = PreparedRobust(problem, "Growing", iterate(problem, growing))
    parts = prepared.solve(Stop(1e-8)).message.split("; ")
    assert [part.split(": ")[0] for part in parts[:3]] == ["Growing", "AndersonSORprox", "Newton steps"]
    assert sum(part.startswith("Growing: ") for part in parts) == 1
    assert parts[-1].endswith(": solved")


def test_sweeps_are_not_accelerated_if_g_is_dense_or_contacts_are_uncoupled() -> None:
    """512 contacts of one slab, and balls that touch nothing but the ground."""
    assert not can_accelerate(load("hard-sliding-block-512"))
    assert not can_accelerate(ContactProblem.from_delassus(np.eye(6), -np.ones(6), 0.5, dim=3))
    assert can_accelerate(load("funnel-30"))


def test_a_problem_without_a_solution_is_proved_infeasible() -> None:
    """Two walls are closer than the body between them: sweeps never converge, and interior points find the proof."""
    assert solve(load("hard-squeezed"), tolerance=1e-8).status is Status.INFEASIBLE


def test_iterations_of_all_parts_are_consecutive_and_observed() -> None:
    seen: list[int] = []
    prepared = create("Robust").prepare(load("funnel-30-late"))
    solution = prepared.solve(Stop(1e-8), observe=lambda iteration, _: seen.append(iteration))
    assert "InteriorPoint" in solution.message
    assert seen == list(range(1, solution.iterations + 1))


@pytest.mark.parametrize("most", [1, WINDOW, WINDOW + 100])
def test_an_iteration_limit_holds_in_every_part(most: int) -> None:
    prepared = create("Robust").prepare(load("hard-stack-100-top-1e8"))
    solution = prepared.solve(Stop(1e-14, most, math.inf))
    assert solution.iterations <= most
    assert solution.status is Status.ITERATION_LIMIT


def test_a_tighter_tolerance_begins_with_the_same_iterates() -> None:
    """No decision depends on the tolerance, so what solves to 1e-6 is an iterate on the way to 1e-10."""
    problem, shown = load("funnel-30-late"), []
    loose = solve(problem, tolerance=1e-6)
    create("Robust").prepare(problem).solve(Stop(1e-10), observe=lambda _, impulses: shown.append(impulses.tobytes()))
    assert loose.impulses.tobytes() in shown


def test_the_best_impulses_of_all_parts_are_returned() -> None:
    """At a limit in the middle of the path, iterates are far from the cones, so the impulses of the sweeps are best."""
    problem = load("pile-100")
    sweeps = select_sweeps(problem).prepare(problem).solve(Stop(1e-15, 2300, math.inf))
    solution = create("Robust").prepare(problem).solve(Stop(1e-15, 2430, math.inf))
    assert "InteriorPoint" in solution.message
    assert judge(problem, solution.impulses).residual <= judge(problem, sweeps.impulses).residual * (1 + 1e-9)


def test_sweeps_use_the_factors_for_a_slab_on_many_supports() -> None:
    """All pairs of the 512 contacts of one body are coupled: G has over a million entries, and is not assembled."""
    assert select_sweeps(load("hard-sliding-block-512")).name == "SORprox(relaxation=1.5, form='factors')"
    assert "form" not in select_sweeps(load("funnel-1000")).name


def test_two_contacts_of_a_mass_ratio_of_1e8_are_solved() -> None:
    """A block of 1e8 kg on one of 1 kg, without friction: Λ₂ = M₂ g Δt, Λ₁ = (M₁ + M₂) g Δt."""
    light, heavy, push = 1.0, 1e8, 9.81e-3
    delassus = np.array([[1.0 / light, -1.0 / light], [-1.0 / light, 1.0 / light + 1.0 / heavy]])
    problem = ContactProblem.from_delassus(delassus, [-push, 0.0], dim=1)
    solution = solve(problem, tolerance=1e-7)
    assert solution.status is Status.SOLVED
    assert solution.impulses == pytest.approx([(light + heavy) * push, heavy * push], rel=1e-6)


def heavy_top_stack(seed: int) -> ContactProblem:
    """Two to five stacked boxes of growing mass on four corners each, at rest up to a small random velocity."""
    rng = np.random.default_rng(seed)
    n, ratio, friction = int(rng.integers(2, 6)), 10.0 ** rng.uniform(0.0, 5.0), rng.uniform(0.3, 0.9)
    masses = ratio ** (np.arange(n) / (n - 1))
    edge, height = 0.2, 0.1
    inertia = np.array([(height**2 + edge**2) / 12.0] * 2 + [edge**2 / 6.0])
    columns = []
    for box, x, y in itertools.product(range(n), (-1, 1), (-1, 1)):
        jitter = 1e-3 * rng.normal(size=2)
        point = np.array([x * edge / 2 + jitter[0], y * edge / 2 + jitter[1], -height / 2])
        for axis in np.eye(3)[[2, 0, 1]]:  # the normal is the third one
            direction = np.zeros((n, 6))
            direction[box] = [*axis, *np.cross(point, axis)]
            if box:
                direction[box - 1] = [*-axis, *-np.cross(point + np.array([0.0, 0.0, height]), axis)]
            columns.append(direction.ravel())
    directions = np.array(columns).T
    inverse_mass = np.concatenate([[1.0 / mass] * 3 + [*1.0 / (mass * inertia)] for mass in masses])
    velocity = np.tile([0.0, 0.0, -0.02, 0.0, 0.0, 0.0], n)
    velocity += rng.normal(size=6 * n) * np.tile([1.0] * 3 + [5.0] * 3, n) * 10.0 ** rng.uniform(-5.0, -2.0)
    return ContactProblem.from_factors(directions, inverse_mass, directions.T @ velocity, friction, dim=3)


@pytest.mark.parametrize("seed", [3, 58, 78, 132])
def test_stacks_of_boxes_with_a_heavy_top_are_solved(seed: int) -> None:
    """Contacts are redundant, and some open or slip slowly; sweeps end near 0.01 if masses differ."""
    problem = heavy_top_stack(seed)
    solution = solve(problem, tolerance=1e-8)
    assert solution.status is Status.SOLVED
    assert judge(problem, solution.impulses).residual <= 1e-8


def test_methods_after_the_first_window_use_one_thread_of_numerical_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hard problems amplify rounding, so the outcome would depend on the number of cores."""

    def threads() -> list[int]:
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    during: dict[str, list[int]] = {}
    for name in ("run_sweeps", "accelerated_sweeps", "run_newton_steps", "run_sequence"):
        run = getattr(robust, name)

        def watched(*arguments: Any, name: str = name, run: Any = run, **options: Any) -> Any:
            during.setdefault(name, threads())
            return run(*arguments, **options)

        monkeypatch.setattr(robust, name, watched)
    with threadpool_limits(2):
        before = threads()
        robust.prepare_by_parts(load("funnel-30")).solve(Stop(1e-8))
        assert during == {"run_sweeps": before}
        robust.prepare_by_parts(load("funnel-30-late")).solve(Stop(1e-8))
        assert threads() == before
    assert max(before) > 1
    later = {name: set(found) for name, found in during.items() if name != "run_sweeps"}
    assert later == {"accelerated_sweeps": {1}, "run_newton_steps": {1}, "run_sequence": {1}}
