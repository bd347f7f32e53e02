"""The tables of captured models agree with the steps and the solvers."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

import captured_models


def test_a_row_has_both_residuals_and_the_identities_of_a_model(monkeypatch: pytest.MonkeyPatch) -> None:
    few = captured_models.CaptureOptions(duration=0.04, every=10)
    boxes = [(name, model, few, keyframe) for name, model, _, keyframe in captured_models.models(None)][1:]
    monkeypatch.setattr(captured_models, "models", lambda suite: boxes)
    _, _, row = captured_models.model_rows(Path())
    name, steps, rows, *residuals, matrix, offset, velocity = row.strip("| ").split(" | ")
    assert (name, int(steps), int(rows)) == ("three boxes, 1:10:100", 2, 48)
    own, coulomb, _ = (float(one.split(", ")[0]) for one in residuals)
    assert own < 1e-10 < 1e-5 < coulomb
    assert max(map(float, (matrix, offset, velocity))) <= 1e-12


def test_a_wrong_identity_ends_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(captured_models, "identity_errors", lambda *step: (0.0, 1e-9, 0.0))
    with pytest.raises(SystemExit, match=r"an identity of thrown cube.* is off by 1\.0e-09"):
        list(captured_models.model_rows(None))


def test_mujoco_solves_its_model_and_robust_solves_coulombs_law() -> None:
    _, model, _, _ = list(captured_models.models(None))[1]
    *_, step = captured_models.captured(model, captured_models.CaptureOptions(0.4, 100))
    found = captured_models.measure(step.step.problem, rounds=1)
    assert list(found) == ["Newton", "CG", "PGS", "Robust"]
    own, coulomb, seconds = (dict(zip(found, values, strict=True)) for values in np.array(list(found.values())).T)
    assert own["Newton"] < 1e-8 < 1e-4 < own["Robust"]
    assert coulomb["Robust"] <= 1e-8 < 1e-4 < coulomb["Newton"]
    assert min(seconds.values()) > 0.0


def test_the_thrown_cube_solves_its_model_and_is_far_from_coulombs_law() -> None:
    found = captured_models.first_contact()
    assert found.own < 1e-13
    assert found.coulomb == pytest.approx(0.0765, abs=5e-4)
    assert found.impulse_error == pytest.approx(0.61, abs=5e-3)
    assert found.robust <= 1e-8
