"""The reported residuals of a bundle are checked against its impulses, whatever its checksum."""

import dataclasses
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from proxbench.bench import Run, rejudge
from proxbench.bench.store.bundles.bundle import Bundle, write_bundle
from proxbench.bench.store.impulses import Impulses
from proxbench.bench.store.outcome import ON_COPY, Outcome, verdicts
from proxbench.bench.store.records import CaseRecord, Measured, Point
from proxbench.problems import ContactProblem
from proxbench.problems.contact.model import Model

Attack = Callable[[Bundle, CaseRecord], CaseRecord]


def finest(case: CaseRecord) -> tuple[int, Measured]:
    level = max(level for level, point in enumerate(case.points) if point.measured is not None)
    measured = case.points[level].measured
    assert measured is not None
    return level, measured


def with_point(case: CaseRecord, level: int, **changes: Any) -> CaseRecord:
    points: list[Point] = list(case.points)
    points[level] = replace(points[level], **changes)
    return replace(case, points=points)


def with_measured(case: CaseRecord, **changes: Any) -> CaseRecord:
    level, measured = finest(case)
    return with_point(case, level, measured=replace(measured, **changes))


def with_impulses(case: CaseRecord, change: Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]) -> CaseRecord:
    """Replace the impulses, but not the residuals reported for them."""
    measured = finest(case)[1]
    nothing = verdicts(ContactProblem.from_delassus(np.eye(3), (-1.0, 0.0, 0.0), 0.3), np.zeros(3), Model.COULOMB)
    kept = [
        replace(one, packed=Impulses.of(change(one.unpacked(case.n_rows)), *nothing).packed)
        for one in measured.impulses
    ]
    return with_measured(case, impulses=kept)


def claimed(case: CaseRecord, factor: float, outcome: Outcome = Outcome.SOLVED) -> CaseRecord:
    """Multiply all residuals of the finest point by a factor, and report it as solved with ``outcome``."""
    level, measured = finest(case)
    kept = [
        replace(one, residual=factor * (one.residual or 0.0), model_residual=factor * (one.model_residual or 0.0))
        for one in measured.impulses
    ]
    verdict = {**measured.verdict, "residual": factor * (measured.residual or 0.0)}
    made = with_measured(
        case,
        impulses=kept,
        verdict=verdict,
        residual=max(one.residual or 0.0 for one in kept),
        model_residual=max(one.model_residual or 0.0 for one in kept),
    )
    return with_point(made, level, outcome=outcome, status="solved")


def other_verdict(name: str, value: Any) -> Attack:
    return lambda bundle, case: with_measured(case, verdict={**finest(case)[1].verdict, name: value})


def coarse(**changes: Any) -> Attack:
    def attack(bundle: Bundle, case: CaseRecord) -> CaseRecord:
        measured = case.points[0].measured
        assert measured is not None
        return with_point(case, 0, outcome=Outcome.SOLVED, status="solved", measured=replace(measured, **changes))

    return attack


def others(bundle: Bundle, case: CaseRecord) -> CaseRecord:
    """Replace the impulses by those of another solver."""
    other = next(one for one in bundle.cases if one.problem == case.problem and one.solver != case.solver)
    return with_measured(case, impulses=[replace(finest(other)[1].impulses[0])])


ATTACKS: dict[str, tuple[Attack, str]] = {
    "a residual ten times less": (lambda bundle, case: claimed(case, 0.1), "the judge finds|counts as solved"),
    "a residual one percent less": (lambda bundle, case: claimed(case, 0.99), "the judge finds|counts as solved"),
    "no residual": (lambda bundle, case: claimed(case, 0.0), "the judge finds"),
    "a residual of the point alone": (
        lambda bundle, case: with_measured(case, residual=1e-15, model_residual=1e-15),
        "is not that of its impulses|counts as",
    ),
    "half the impulses": (lambda bundle, case: with_impulses(case, lambda x: 0.5 * x), "the judge finds"),
    "no impulses": (lambda bundle, case: with_impulses(case, np.zeros_like), "the judge finds"),
    "impulses in another order": (lambda bundle, case: with_impulses(case, lambda x: x[::-1]), "the judge finds"),
    "an impulse that is no number": (
        lambda bundle, case: with_impulses(case, lambda x: np.where(np.arange(len(x)) == 1, np.nan, x)),
        "the judge finds",
    ),
    "one impulse more": (lambda bundle, case: with_impulses(case, lambda x: np.append(x, 0.0)), "the data exceed"),
    "one impulse less": (lambda bundle, case: with_impulses(case, lambda x: x[:-1]), "one per row"),
    "impulses that are none": (
        lambda bundle, case: with_measured(
            case, impulses=[replace(one, packed=b"no zlib") for one in finest(case)[1].impulses]
        ),
        "the compressed data are damaged",
    ),
    "impulses and more": (
        lambda bundle, case: with_measured(
            case, impulses=[replace(one, packed=one.packed + b"more") for one in finest(case)[1].impulses]
        ),
        "the compressed data are damaged",
    ),
    "another model": (
        lambda bundle, case: replace(case, model="frictionless" if case.model == "convex" else "convex"),
        "the judge finds|counts as solved",
    ),
    "a model that is none": (lambda bundle, case: replace(case, model="exact"), "there is no model 'exact'"),
    "a model of far too many sides": (
        lambda bundle, case: replace(case, model=f"pyramid({10**9})"),
        "has too many sides",
    ),
    "another digest": (lambda bundle, case: replace(case, digest="0" * 64), "a problem with other numbers"),
    "more contacts": (lambda bundle, case: replace(case, n_contacts=case.n_contacts + 1), "with other numbers"),
    "another complementarity": (other_verdict("complementarity", 7.0), "complementarity 7"),
    "another penetration": (other_verdict("penetration_velocity", -1.0), "penetration velocity -1"),
    "another local residual": (other_verdict("local_residual", 123.0), "local residual 1.23"),
    "no energy": (other_verdict("dissipated_energy", None), "dissipated energy inf"),
    "infeasible": (other_verdict("infeasible", True), "infeasible True"),
    "a number that is a truth": (other_verdict("natural_map_q", True), "natural map q True"),
    "a verdict of more": (other_verdict("beauty", 1.0), "does not have the entries of that of the judge"),
    "a coarse point solved with a large residual": (
        coarse(residual=0.9, model_residual=0.9),
        "counts as solved with the residual 9.0e-01",
    ),
    "a point solved against its solver": (
        lambda bundle, case: with_point(case, 0, outcome=Outcome.SOLVED, status="stalled"),
        "the status of its solver is 'stalled'",
    ),
    "a right claim that counts as wrong": (
        lambda bundle, case: with_point(case, 0, outcome=Outcome.WRONG, status="solved"),
        "counts as wrong with the residual",
    ),
    "a measurement that is left out": (
        lambda bundle, case: with_point(case, 0, outcome=Outcome.SOLVED, status="solved", measured=None),
        "without a measurement",
    ),
    "the impulses of another solver": (others, "the judge finds|is not that of its impulses|counts as"),
}


def forged(bundle: Bundle, indices: Sequence[int], attack: Attack, path: Path) -> Path:
    """Write a bundle with some cases changed, and all checksums right."""
    cases = [attack(bundle, case) if index in indices else case for index, case in enumerate(bundle.cases)]
    write_bundle(dataclasses.replace(bundle, cases=cases), path)
    return path


def is_lie(name: str, case: CaseRecord) -> bool:
    """Return whether an attack makes a statement that is false beyond rounding."""
    measured = finest(case)[1]
    impulses = measured.impulses[0].unpacked(case.n_rows)
    if name == "a right claim that counts as wrong":
        return case.points[0].outcome in (Outcome.SOLVED, Outcome.RELAXED)
    if name == "another model":  # a sticking contact satisfies several models
        return case.problem == "funnel-30"
    if "residual" in name and "local" not in name and "coarse" not in name:
        return (measured.residual or 0.0) > 1e-9
    return bool(impulses.any()) or "impulses" not in name


def test_an_unchanged_bundle_is_rejudged_to_equal_bits(made: Run, file: Path) -> None:
    found = rejudge(file)
    assert found.disagreements == []
    assert (found.n_cases, found.n_judged) == (12, 12)
    assert found.n_residuals == found.n_identical >= 24
    assert found.sentence.startswith("12 of 12 cases judged again: ")


def test_a_claim_that_is_wrong_on_a_copy_of_its_problem_agrees(honest: Bundle, tmp_path: Path) -> None:
    def refuted(bundle: Bundle, case: CaseRecord) -> CaseRecord:
        return with_point(case, 0, outcome=Outcome.WRONG, status="solved", reason=f"{ON_COPY}, claimed 1e-02")

    assert rejudge(forged(honest, [0], refuted, tmp_path / "copy.bundle")).disagreements == []


@pytest.mark.parametrize("first", [1, pytest.param(None, marks=pytest.mark.slow, id="all")])
@pytest.mark.parametrize("name", ATTACKS)
def test_rejudge_detects_changes_with_valid_checksums(
    name: str, first: int | None, honest: Bundle, tmp_path: Path
) -> None:
    attack, reason = ATTACKS[name]
    lies = [index for index, case in enumerate(honest.cases) if is_lie(name, case)]
    assert len(lies) >= 4
    found = rejudge(forged(honest, lies[:first], attack, tmp_path / "forged.bundle")).disagreements
    for index, sentence in zip(lies[:first], found, strict=True):
        case = honest.cases[index]
        assert sentence.startswith(f"{case.solver} on {case.problem}: ")
        assert re.search(reason, sentence), sentence
