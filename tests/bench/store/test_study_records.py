"""Inconsistent plans of stored studies are refused, whatever their origin."""

from typing import Any

import pytest
from proxbench.bench.measure.machine import this_machine
from proxbench.bench.measure.trajectories.plan import make_study_plan
from proxbench.bench.store.conversion import content_of, record_of
from proxbench.bench.store.plans import PlanRecord
from proxbench.bench.store.records import RunRecord


@pytest.fixture
def content() -> dict[str, Any]:
    """The content of run.json of a study."""
    plan = make_study_plan("pile(balls=3)", members=(0, 1), methods={"Moreau with SORprox": (1e-3,)})
    trajectory = content_of(plan.record.trajectories[0])
    trajectory["known"] = [{"member": seed, "values": {"mean height": 1.0}} for seed in (0.0, 1.0)]
    written: dict[str, Any] = {
        "problems": [trajectory["name"]],
        "solvers": ["Moreau with SORprox"],
        "tolerances": [1e-2],
        "limits": {},
        "methods": [content_of(method.record) for method in plan.solvers],
        "trajectories": [trajectory],
    }
    return {"run_id": "it", "plan": written, "machine": content_of(this_machine()), "plugins": []}


def test_a_plan_of_a_study_can_be_read_back(content: dict[str, Any]) -> None:
    record = record_of(content, RunRecord)
    assert content_of(record)["plan"]["trajectories"][0]["name"] == "pile(balls=3)"
    assert record.plan.ladder("Moreau with SORprox") == [1e-3]


def test_a_run_over_contact_problems_has_one_ladder_for_all(content: dict[str, Any]) -> None:
    plan = record_of(content, RunRecord).plan
    plain = PlanRecord(problems=["a"], solvers=["b"], tolerances=plan.tolerances, limits=plan.limits)
    assert plain.ladder("b") == [1e-2]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("problems",), ["another"]),
        (("solvers",), ["another"]),
        (("trajectories",), []),
        (("trajectories", 0, "error"), "distance"),
        (("trajectories", 0, "duration"), 0.0),
        (("trajectories", 0, "members"), []),
        (("trajectories", 0, "known", 0, "values"), {"another": 1.0}),
        (("methods", 0, "values"), []),
        (("methods", 0, "values"), [2.0]),
        (("methods", 0, "max_iterations"), -1),
    ],
)
def test_an_inconsistent_study_plan_is_refused(content: dict[str, Any], path: tuple[Any, ...], value: Any) -> None:
    place: Any = content["plan"]
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(ValueError, match="plan"):
        record_of(content, RunRecord)
