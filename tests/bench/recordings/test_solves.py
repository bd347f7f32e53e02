"""A recording of solves shows the iterations of the solvers side by side."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from misbehaving_solvers import Misbehaving
from proxbench.bench.errors import BenchError
from proxbench.bench.recordings.contact_points import grid_contact_points
from proxbench.bench.recordings.contact_states import ContactState
from proxbench.bench.recordings.solves import RecordedSolves, record_solves
from proxbench.problems import ContactProblem, judge, load
from proxbench.solvers import Stop, create

STOP = Stop(1e-6, 200)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedSolves:
    """Four solvers on a funnel, of which one raises and one does not support the problem."""
    solvers = [create("SORprox"), create("JORprox(relaxation=0.5)"), Misbehaving("raise"), create("Enumeration")]
    return record_solves(load("funnel-30"), solvers, STOP, tmp_path_factory.mktemp("solves") / "a.rrd")


def test_curves_in_the_file_are_those_of_the_judge(recorded: RecordedSolves, read_back: Callable[[Path], Any]) -> None:
    curve = read_back(recorded.file).curve("/curves/residual/0")
    problem = load("funnel-30")
    solution = create("SORprox").prepare(problem).solve(STOP)
    assert list(curve) == list(range(solution.iterations + 1))
    assert curve[solution.iterations] == pytest.approx(np.log10(judge(problem, solution.impulses).residual), rel=1e-9)


def test_arrows_are_the_impulses_at_the_contacts(recorded: RecordedSolves, read_back: Callable[[Path], Any]) -> None:
    content, problem = read_back(recorded.file), load("funnel-30")
    trace = recorded.traces[0]
    origins = np.array(content.static("/solvers/0/impulses", "Arrows3D:origins"))
    np.testing.assert_allclose(origins, recorded.contact_points.positions, atol=1e-7)
    arrows = content.over_time("/solvers/0/impulses", "Arrows3D:vectors")
    assert list(arrows) == trace.shown
    drawn = np.array(arrows[trace.shown[-1]])
    true = recorded.contact_points.vectors(trace.impulses[-1])
    assert drawn.shape == (problem.n_contacts, 3)
    short = np.linalg.norm(drawn, axis=1) < 0.99 * np.linalg.norm(drawn, axis=1).max()
    scales = np.linalg.norm(drawn[short], axis=1) / np.maximum(np.linalg.norm(true[short], axis=1), 1e-300)
    closed = np.linalg.norm(true[short], axis=1) > 0
    np.testing.assert_allclose(scales[closed], np.median(scales[closed]), rtol=1e-4)


def test_balls_are_drawn_for_all_solvers(recorded: RecordedSolves, read_back: Callable[[Path], Any]) -> None:
    content, bodies = read_back(recorded.file), recorded.contact_points.bodies
    assert bodies is not None
    half_sizes = np.array(content.static("/bodies/balls", "Ellipsoids3D:half_sizes"))
    np.testing.assert_allclose(half_sizes.T, 3 * [bodies.radii], rtol=1e-6)
    np.testing.assert_allclose(content.static("/bodies/balls", "Ellipsoids3D:centers"), bodies.centres, atol=1e-7)
    assert str(content.blueprint).count("/bodies/**") == 4
    (about,) = content.static("/about", "TextDocument:text")
    assert f"{len(bodies.radii)} balls" in about


def test_colours_are_the_states_of_the_contacts(recorded: RecordedSolves, read_back: Callable[[Path], Any]) -> None:
    content = read_back(recorded.file)
    last = recorded.traces[0].shown[-1]
    classes = content.over_time("/solvers/0/impulses", "Arrows3D:class_ids")[last]
    assert classes == content.over_time("/solvers/0/contacts", "Points3D:class_ids")[last]
    for state in ContactState:
        count = content.curve(f"/states/0/{state.name.lower()}")[last]
        assert classes.count(int(state)) == count
    assert content.curve("/states/0/stick")[last] > 0
    assert content.curve("/states/0/slip")[last] > 0


def test_one_bad_solver_does_not_spoil_the_others(recorded: RecordedSolves, read_back: Callable[[Path], Any]) -> None:
    (about,) = read_back(recorded.file).static("/about", "TextDocument:text")
    assert "RuntimeError: the plugin gave up" in about
    assert "Enumeration" in about
    assert [trace.has_failed for trace in recorded.traces] == [False, False, True, False]
    assert len(recorded.traces[1].shown) > 20


def test_the_file_opens_with_a_view_for_every_solver_and_the_curves(
    recorded: RecordedSolves, read_back: Callable[[Path], Any]
) -> None:
    layout = str(read_back(recorded.file).blueprint)
    for words in ("SORprox", "JORprox(relaxation=0.5)", "Misbehaving(raise)", "log₁₀ residual", "what this shows"):
        assert words in layout
    assert layout.count("'3D'") == 4
    assert "iteration" in layout


def test_diverging_solver_does_not_distort_the_scale(tmp_path: Path, read_back: Callable[[Path], Any]) -> None:
    problem = load("funnel-100")
    made = record_solves(problem, [create("Jprox"), create("SORprox")], STOP, tmp_path / "a.rrd")
    content = read_back(made.file)
    lengths = [
        np.linalg.norm(np.array(arrows), axis=1).max()
        for solver in (0, 1)
        for arrows in content.over_time(f"/solvers/{solver}/impulses", "Arrows3D:vectors").values()
    ]
    assert max(lengths) < 10 * made.contact_points.size
    assert max(content.curve("/curves/residual/0").values()) < 4.0
    assert made.traces[0].residual[-1] > 1e6


@pytest.mark.parametrize("name", ["hard-no-motion", "hard-immovable", "hard-tresca-joint", "hard-mixed-laws"])
def test_degenerate_and_mixed_problems_can_be_recorded(
    tmp_path: Path, name: str, read_back: Callable[[Path], Any]
) -> None:
    made = record_solves(load(name), [create("SORprox"), create("Jprox")], STOP, tmp_path / "a.rrd")
    for solver in (0, 1):
        assert np.isfinite(list(read_back(made.file).curve(f"/curves/residual/{solver}").values())).all()


@pytest.mark.parametrize(
    ("velocity", "scale"), [(-1.0, "bodies is 1 N s."), (1.0, "no last iterate is finite and nonzero")]
)
def test_the_explanation_gives_the_scale_of_arrows_unless_there_are_none(
    velocity: float, scale: str, tmp_path: Path, read_back: Callable[[Path], Any]
) -> None:
    """A mass of 1 kg that approaches at 1 m/s takes 1 N s; one that departs takes no impulse."""
    problem = ContactProblem.from_delassus(np.eye(3), np.array([velocity, 0.0, 0.0]), 0.3)
    made = record_solves(problem, [create("SORprox")], STOP, tmp_path / "a.rrd")
    (about,) = read_back(made.file).static("/about", "TextDocument:text")
    assert ": 1 contact, 3 rows." in about
    assert scale in about


def test_given_contact_points_are_used_and_must_fit(tmp_path: Path, read_back: Callable[[Path], Any]) -> None:
    problem = load("hard-sticking-box")
    made = record_solves(problem, [create("SORprox")], STOP, tmp_path / "a.rrd", contact_points=grid_contact_points(4))
    assert read_back(made.file).static("/solvers/0/impulses", "Arrows3D:origins")[3] == [1.0, 1.0, 0.0]
    with pytest.raises(BenchError, match="there are 5 contact points"):
        record_solves(problem, [create("SORprox")], STOP, tmp_path / "b.rrd", contact_points=grid_contact_points(5))
    assert not (tmp_path / "b.rrd").exists()


def test_a_recording_without_contacts_or_solvers_is_refused(tmp_path: Path) -> None:
    empty = ContactProblem.from_delassus(np.zeros((0, 0)), np.zeros(0), 0.3)
    with pytest.raises(BenchError, match="no contacts"):
        record_solves(empty, [create("SORprox")], STOP, tmp_path / "a.rrd")
    with pytest.raises(BenchError, match="at least one solver"):
        record_solves(load("hard-no-motion"), [], STOP, tmp_path / "a.rrd")
    assert list(tmp_path.iterdir()) == []
