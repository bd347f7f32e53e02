"""One call draws a problem, a profile or a convergence, or raises an error with the reason."""

import json

import pytest
from proxbench.bench import Run, plot_convergence
from proxbench.bench.errors import BenchError


@pytest.mark.slow
def test_a_problem_is_drawn_by_name(reference_run: Run) -> None:
    chart = json.loads(reference_run.plot("funnel-100").to_json())
    assert chart["title"]["text"] == "funnel-100"
    assert len(chart["vconcat"]) >= 2


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("kind", "title"),
    [("performance", "Performance profile"), ("speedup", "Speed-up")],
)
def test_a_profile_is_drawn_by_kind(kind: str, title: str, reference_run: Run) -> None:
    assert json.loads(reference_run.plot_profile(kind, "NSGS").to_json())["title"]["text"] == title


@pytest.mark.slow
def test_unknown_names_are_refused_with_the_nearest_one(reference_run: Run) -> None:
    with pytest.raises(BenchError, match="did you mean 'funnel-100'"):
        reference_run.plot("funel-100")
    with pytest.raises(BenchError, match="did you mean 'performance'"):
        reference_run.plot_profile("performence")


@pytest.mark.slow
def test_a_solver_without_iterates_is_named_when_its_convergence_is_drawn() -> None:
    with pytest.raises(BenchError, match="no iterates of Lemke were recorded on hard-sticking-box; choose a solver"):
        plot_convergence("hard-sticking-box", "Lemke")


@pytest.mark.slow
def test_convergence_of_solvers_is_drawn_in_one_call() -> None:
    chart = json.loads(plot_convergence("hard-sticking-box", ["SORprox", "NSGS"]).to_json())
    drawn = {row["solver"] for rows in chart["datasets"].values() for row in rows}
    assert {"SORprox", "NSGS"} <= drawn
