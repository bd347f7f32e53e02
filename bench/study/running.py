"""Running a study: one simulation after the other, each stored as soon as it is over."""

from collections.abc import Callable, Mapping
from pathlib import Path

from .measuring import Measured, measure, warm_up
from .plan import REFERENCE, Case, StudyPlan
from .points import Point, aggregate_points, seed_spreads, trajectory_point
from .study import Study

OnProgress = Callable[[Study, Case], None]
"""Called before every simulation with the study as far as it has come, and the case that comes next."""


def run_study(
    plan: StudyPlan,
    file: Path | None = None,
    *,
    on_progress: OnProgress = lambda study, case: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> Study:
    """Measure every case of ``plan``; return the study.

    Args:
        plan: ``make_study_plan`` makes it.
        file: where it is stored after every simulation, replacing what is there; nothing is stored if None.
        on_progress: called before every simulation.
        should_stop: called after every step, whether to stop; the simulation in hand is left out then.

    Raises:
        BenchError: if the file cannot be written.
    """
    study = Study(plan, file)
    advance_study(study, on_progress, should_stop)
    return study


def advance_study(
    study: Study,
    on_progress: OnProgress = lambda study, case: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> None:
    """Measure what is left; whatever ends it, the file holds every simulation that is over.

    A simulation that fails is noted with its reason, and the others go on.
    """
    study.store()  # finds out now that nothing can be written
    warm: set[tuple[str, str]] = set()
    for number, place in _order(study.plan):
        if (number, place) in study.measured:
            continue
        case = study.plan.cases[number]
        on_progress(study, case)
        kind = (case.stepper.split("(")[0], case.solver)
        if kind not in warm:
            warm_up(study.plan, case, should_stop)
            warm.add(kind)
        measured = measure(study.plan, case, case.members[place], should_stop)
        if measured is None:
            return
        study.measured[number, place] = measured
        study.store()


def _order(plan: StudyPlan) -> list[tuple[int, int]]:
    """Return case and member in rounds: a machine that is slow for a while is so for one member of every case."""
    runs = [(number, place) for number, case in enumerate(plan.cases) for place in range(len(case.members))]
    return sorted(runs, key=lambda run: (run[1], run[0]))


def points(study: Study) -> list[Point]:
    """Return the points of the diagram, as far as the study has come."""
    numbered = [(number, case) for number, case in enumerate(study.plan.cases) if case.part != REFERENCE]
    if study.plan.scene == "woodpecker":
        found = [trajectory_point(case, study.members(number)) for number, case in numbered]
        return [point for point in found if point is not None]
    against = reference(study)
    return [point for number, case in numbered for point in aggregate_points(case, study.members(number), against)]


def reference(study: Study) -> Mapping[float, Measured]:
    """Return what was measured of the reference, by seed; empty where there is none."""
    places = [number for number, case in enumerate(study.plan.cases) if case.part == REFERENCE]
    return study.members(places[0]) if places else {}


def spreads(study: Study) -> dict[str, tuple[float, float]]:
    """Return mean and relative standard error of every aggregate of the reference; empty where there is none."""
    return seed_spreads(reference(study))


def failures(study: Study) -> list[str]:
    """Return one sentence for every kind of failure of a case."""
    found: dict[str, None] = {}
    for number, case in enumerate(study.plan.cases):
        for one in study.members(number).values():
            if one.failure:
                found[f"{case.series}, {case.setting}, {case.solver} to {case.tolerance:.0e}: {one.failure}"] = None
    return list(found)
