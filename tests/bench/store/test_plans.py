"""A plan knows the ladder, family and trajectory of each name, and refuses inconsistent records."""

from typing import Any

import pytest
from msgspec.structs import replace
from proxbench.bench.errors import BenchError
from proxbench.bench.store.plans import (
    LADDER,
    MAX_PASSES,
    PASSES,
    THOROUGH_LADDER,
    THOROUGH_PASSES,
    MethodRecord,
    PlanRecord,
    ReferenceRecord,
    RunSettings,
    TrajectoryRecord,
)

METHOD = MethodRecord(name="Moreau with NSGS", values=[1e-2, 1e-3], tolerance=1e-8, max_iterations=9, start="warm")
TRAJECTORY = TrajectoryRecord(name="stack", duration=1.0, members=[1.0], error="end position")
STUDY = PlanRecord(problems=["stack"], solvers=["Moreau with NSGS"], methods=[METHOD], trajectories=[TRAJECTORY])


def known(failure: str = "", **values: float) -> ReferenceRecord:
    return ReferenceRecord(member=1.0, values=values, failure=failure)


def test_members_of_a_reference_have_values_of_the_same_names_unless_they_failed() -> None:
    alike = [known(x=1.0, y=2.0), known(y=0.0, x=5.0), known("too long")]
    assert replace(TRAJECTORY, known=alike).known == alike
    with pytest.raises(ValueError, match="members of its reference have values of different names"):
        replace(TRAJECTORY, known=[known(x=1.0), known(x=1.0, y=2.0)])


@pytest.mark.parametrize(
    "changes",
    [{"problems": ["pile"]}, {"solvers": ["NSGS"]}, {"methods": []}, {"trajectories": []}, {"problems": []}],
)
def test_the_names_of_a_study_are_those_of_its_trajectories_and_methods(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="names differ from those"):
        replace(STUDY, **changes)


def test_a_method_has_a_ladder_of_its_own_and_a_solver_that_of_the_run() -> None:
    assert STUDY.ladder("Moreau with NSGS") == [1e-2, 1e-3]
    assert PlanRecord(problems=["p"], solvers=["NSGS"], tolerances=[0.5]).ladder("NSGS") == [0.5]
    assert STUDY.trajectory("stack") is TRAJECTORY


def test_the_family_of_a_problem_is_the_stored_one_or_else_that_of_its_name() -> None:
    plan = PlanRecord(problems=["funnel-30", "pile-30"], solvers=[], families={"funnel-30": "mine"})
    assert (plan.family("funnel-30"), plan.family("pile-30")) == ("mine", "pile")


@pytest.mark.parametrize(("passes", "seed"), [(1, 0), (MAX_PASSES, 2**63 - 1)])
def test_settings_may_reach_their_bounds(passes: int, seed: int) -> None:
    made = RunSettings.checked([1e-3, 0.5], passes=passes, seed=seed)
    assert (made.tolerances, made.passes, made.seed) == ([0.5, 1e-3], passes, seed)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"passes": MAX_PASSES + 1}, "`passes` must be between 1 and 1000, got 1001"),
        ({"passes": 0}, "`passes` must be between"),
        ({"seed": 2**63}, "`seed` must be at least 0 and less than"),
        ({"tolerances": [1e-2, 1.0]}, "`tolerances` must be between 0 and 1, got 1; choose"),
        ({"tolerances": [2.0]}, "`tolerances` must be between 0 and 1, got 2; choose"),
        ({"tolerances": [0.0]}, "`tolerances` must be between 0 and 1, got 0; choose"),
    ],
)
def test_settings_beyond_their_bounds_are_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(BenchError, match=words):
        RunSettings.checked(**arguments)


def test_a_thorough_run_has_its_own_defaults() -> None:
    quick, thorough = RunSettings.checked(), RunSettings.checked(thorough=True)
    assert (tuple(quick.tolerances), quick.passes) == (LADDER, PASSES)
    assert (tuple(thorough.tolerances), thorough.passes) == (THOROUGH_LADDER, THOROUGH_PASSES)
