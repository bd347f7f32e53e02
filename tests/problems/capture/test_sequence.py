"""A capture is a suite of steps with persistent names; a failure keeps the steps before it."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.problems import ProblemError, load, save_problem
from proxbench.problems.capture.files import read_step
from proxbench.problems.capture.rows import IMMOBILE
from proxbench.problems.capture.sequence import CaptureOptions, capture, captured_steps
from proxbench.problems.engine_model import judge_own_model
from proxbench.problems.exchange.folder import list_folder
from small_models import CUBE, STACK, WELDED, moving, refuse_first_rows

mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")

BOXES = STACK.format(cone="elliptic", integrator="Euler", solver="Newton")


@pytest.fixture
def boxes(tmp_path: Path) -> Path:
    file = tmp_path / "box-stack.xml"
    file.write_text(BOXES)
    return file


def test_steps_become_a_suite_with_one_family_a_model(boxes: Path, tmp_path: Path) -> None:
    output = tmp_path / "steps"
    summary = capture(boxes, output, CaptureOptions(duration=0.06, every=10))
    assert [file.name for file in summary.files] == [f"box-stack-{number:06d}.npz" for number in (0, 10, 20)]
    assert summary.engine_rows == 3 * 36
    suite = list_folder(output)
    assert suite.name == "steps"
    assert {member.family for member in suite.members} == {"box-stack"}
    provenance = load(summary.files[1]).provenance
    assert (provenance["sequence"], provenance["step"], provenance["time"]) == ("box-stack", 10, pytest.approx(0.02))
    cube = tmp_path / "cube.xml"
    cube.write_text(CUBE)
    capture(cube, output, CaptureOptions(duration=0.01, every=1))
    assert {member.family for member in list_folder(output).members} == {"box-stack", "cube"}


def test_contact_keys_persist_between_steps(boxes: Path, tmp_path: Path) -> None:
    summary = capture(boxes, tmp_path / "steps", CaptureOptions(duration=0.2, every=10))
    steps = [read_step(file) for file in summary.files]
    assert {len(set(step.keys)) for step in steps} == {12}
    assert len({frozenset(step.keys) for step in steps}) == 1
    for before, after in pairwise(steps):
        for index, key in enumerate(before.keys):
            moved = after.anchors[after.keys.index(key)] - before.anchors[index]
            assert np.linalg.norm(moved, axis=-1).min() < 0.01


def test_a_file_holds_the_problem_and_what_the_engine_made_of_it(boxes: Path, tmp_path: Path) -> None:
    taken: list[Any] = []
    summary = capture(boxes, tmp_path, CaptureOptions(duration=0.002, every=1), on_step=taken.append)
    step = read_step(summary.files[0])
    assert load(summary.files[0]).digest == step.problem.digest == taken[0].problem.digest
    assert judge_own_model(step.engine, step.forces) == judge_own_model(taken[0].engine, taken[0].forces)
    assert np.array_equal(step.impulses, taken[0].impulses)
    assert (step.keys, step.engine.name) == (taken[0].keys, f"MuJoCo {mujoco.__version__}")
    save_problem(step.problem, tmp_path / "plain.npz")
    with pytest.raises(ProblemError, match="contains a problem but no captured step"):
        read_step(tmp_path / "plain.npz")


def test_a_failure_keeps_the_steps_before_it(boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step, called = mujoco.mj_step, []

    def failing(model: Any, data: Any) -> None:
        called.append(data)
        if len(called) > 346:  # two calls per step, one of them on a copy
            raise mujoco.FatalError("the arena is full")
        step(model, data)

    monkeypatch.setattr(mujoco, "mj_step", failing)
    summary = capture(boxes, tmp_path, CaptureOptions(duration=0.4, every=1))
    assert len(summary.files) == 173
    assert summary.error == (
        "MuJoCo failed in the step at 0.346 s: the arena is full; correct the model, or stop before this step."
    )
    assert len(list_folder(tmp_path).members) == 173


def test_a_reset_of_the_state_ends_a_capture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    model, data = moving(BOXES, 10)
    steps = captured_steps(model, data, CaptureOptions(duration=1.0, every=1000), "boxes")
    next(steps)
    data.qvel[0] = np.nan
    with pytest.raises(ProblemError, match=r"MuJoCo reset the state in the step at 0\.02 s; choose a smaller timestep"):
        next(steps)


def test_a_diverging_model_is_reported_in_one_sentence_without_a_log_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "cube.xml"
    file.write_text(CUBE.replace('qvel="6 0', 'qpos="0 0 0.099 1 0 0 0" qvel="1e12 0'))
    with pytest.raises(ProblemError, match="MuJoCo reset the state in the step at 0 s"):
        capture(file, tmp_path / "steps", CaptureOptions(keyframe="thrown"))
    assert [path.name for path in tmp_path.iterdir()] == ["cube.xml"]


def test_random_controls_repeat_with_their_seed() -> None:
    text = """<mujoco><worldbody><geom type="plane" size="5 5 0.1"/><body pos="0 0 0.099"><freejoint name="f"/>
    <geom size="0.1"/></body></worldbody>
    <actuator><motor joint="f" ctrlrange="2 3"/><motor joint="f"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)

    def controls(seed: int | None) -> list[float]:
        data = mujoco.MjData(model)
        steps = captured_steps(model, data, CaptureOptions(0.1, 1, "", seed), "ball")
        return [data.ctrl.tolist() for _ in steps]

    drawn = controls(1)
    assert drawn == controls(1) != controls(2)
    assert len({tuple(one) for one in drawn}) == 5
    assert 2.0 <= min(one[0] for one in drawn) <= max(one[0] for one in drawn) <= 3.0
    assert controls(None)[0] == [0.0, 0.0]


def test_earlier_steps_are_replaced_only_when_asked(boxes: Path, tmp_path: Path) -> None:
    options = CaptureOptions(duration=0.06, every=10)
    capture(boxes, tmp_path, options)
    with pytest.raises(ProblemError, match="already contains 3 steps of box-stack; choose another `output`"):
        capture(boxes, tmp_path, options)
    capture(boxes, tmp_path, replace(options, every=20), force=True)
    assert len(list_folder(tmp_path).members) == 2
    capture(boxes, tmp_path, replace(options, every=30), force=True)
    with pytest.raises(ProblemError, match="already contains 1 step of box-stack; "):
        capture(boxes, tmp_path, options)


@pytest.mark.parametrize(
    ("text", "options", "sentence"),
    [
        (
            CUBE,
            {"duration": 0.002},
            "has no contact and no other constraint in the 1 step examined during 0.002 s",
        ),
        (CUBE, {"keyframe": "trown"}, "has no keyframe 'trown'; did you mean 'thrown'"),
        ("<mujoco>", {}, r"MuJoCo cannot read .*; correct the model\."),
        (BOXES.replace("Euler", "RK4"), {}, "the integrator RK4 solves the constraints four times"),
    ],
)
def test_a_model_that_cannot_be_captured(text: str, options: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    file = tmp_path / "model.xml"
    file.write_text(text)
    with pytest.raises(ProblemError, match=sentence):
        capture(file, tmp_path / "steps", CaptureOptions(**options))
    assert not (tmp_path / "steps").exists()


def test_rows_refused_in_steps_with_and_without_other_rows_are_listed_by_step(
    boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_first_rows(monkeypatch)
    text = WELDED.replace('<body name="left">', '<geom type="plane" size="5 5 0.1" pos="0 0 -0.11"/><body name="left">')
    file = tmp_path / "welded.xml"
    file.write_text(text)
    summary = capture(file, tmp_path / "steps", CaptureOptions(duration=0.1, every=5))
    landed = int(summary.files[0].stem.removeprefix("welded-"))
    assert list(summary.refused_rows) == list(range(0, 50, 5))
    assert landed > 0
    assert summary.empty == landed // 5
    assert {(row.row, row.name, row.reason) for row in summary.refused_rows[landed]} == {
        (index, "equality weld", IMMOBILE) for index in range(6)
    }
    assert summary.refused == {IMMOBILE: 6 * 10}
    assert summary.engine_rows == 60 + sum(len(read_step(one).forces) - 6 for one in summary.files)


def test_a_model_whose_rows_are_all_refused_is_named_with_a_row_and_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_first_rows(monkeypatch)
    file = tmp_path / "welded.xml"
    file.write_text(WELDED)
    sentence = (
        "no supported constraint in the 1 step examined during 0.002 s: equality weld is refused because it moves"
    )
    with pytest.raises(ProblemError, match=sentence):
        capture(file, tmp_path / "steps", CaptureOptions(duration=0.002))


def test_bad_options_are_refused() -> None:
    with pytest.raises(ProblemError, match="`duration` must be positive and finite"):
        CaptureOptions(duration=float("nan"))
    with pytest.raises(ProblemError, match="`every` must be at least 1"):
        CaptureOptions(every=0)
    with pytest.raises(ProblemError, match="`seed` must not be negative"):
        CaptureOptions(seed=-1)
    with pytest.raises(ProblemError, match=r"there is no model none\.xml"):
        capture(Path("none.xml"), Path("steps"), CaptureOptions())


def test_existing_suite_description_is_kept(boxes: Path, tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text('name = "mine"\n')
    capture(boxes, tmp_path, CaptureOptions(duration=0.002))
    assert list_folder(tmp_path).name == "mine"
