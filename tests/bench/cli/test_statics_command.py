"""``proxbench statics``: one line with the answer, its JSON data, and a sentence for a mistake."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command

BALL = """
from proxbench.problems.motion.scenes.registry import make_scene

def own_box():
    return make_scene("thrown_box")

def lone_ball():
    return make_scene("stack(masses=(1.0,), friction=0.5)")

SCENES = {"lone_ball": lone_ball, "own_box": own_box}
"""


@pytest.mark.parametrize(
    ("arguments", "code", "sentence"),
    [
        (["block_on_incline(slope=0.3)"], 0, "can stand"),
        (["block_on_incline(slope=0.3)", "--friction"], 0, "can stand; it needs a friction coefficient of 0.309336"),
        (
            ["block_on_incline(slope=1.0)"],
            1,
            "cannot stand: bodies accelerate at 51.1 % of the free acceleration; contacts that slide: 1 of 1",
        ),
        (["stack"], 0, "can stand; it bears no push along 1,0,0"),
        (["thrown_box"], 0, "can stand; it bears a push of up to 0.5 of its weight along 1,0,0"),
        (["thrown_box", "--push", "0,0,-1"], 0, "can stand; it bears any push along 0,0,-1"),
        (
            ["v_groove(slope=0.2)", "--friction"],
            1,
            "cannot stand: bodies accelerate at 13.2 % of the free acceleration; no contact slides or opens; "
            "no friction coefficient suffices",
        ),
        (
            ["bouncing_ball"],
            1,
            "cannot stand: bodies accelerate at 100 % of the free acceleration; no contact is closed; "
            "if the bodies should touch, close small gaps with --margin METRES",
        ),
    ],
)
def test_the_answer_is_one_line(
    arguments: list[str], code: int, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["statics", *arguments]) == code
    assert capsys.readouterr().out == f"{arguments[0]} {sentence}\n"


def test_programs_read_the_same_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["statics", "thrown_box", "--push", "0,0,-1", "--friction", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row.pop("imbalance") <= 1e-7
    assert row == {
        "scene": "thrown_box",
        "contacts": 4,
        "can_stand": True,
        "mechanism": "",
        "push": [0.0, 0.0, -1.0],
        "largest_push": None,
        "least_friction": 0.0,
    }


def test_a_margin_closes_contacts_that_are_open(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["statics", "stack(overlap=0)"]) == 1
    assert run_command(["statics", "stack(overlap=0)", "--margin", "1e-6"]) == 0
    assert "can stand" in capsys.readouterr().out


def test_margin_option_is_not_suggested_if_it_was_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["statics", "bouncing_ball", "--margin", "1e-9"]) == 1
    assert capsys.readouterr().out.endswith("no contact is closed\n")


def test_plugin_scene_is_supported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.py").write_text(BALL)
    assert run_command(["statics", "lone_ball", "--plugin", str(tmp_path / "ball.py")]) == 0
    assert capsys.readouterr().out == "lone_ball can stand; it bears no push along 1,0,0\n"
    assert run_command(["statics", "own_box", "--plugin", str(tmp_path / "ball.py")]) == 0
    assert capsys.readouterr().out == "own_box can stand; it bears a push of up to 0.5 of its weight along 1,0,0\n"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("statics nonsense", "there is no scene 'nonsense'"),
        ("statics stack --margin -1", "--margin must be a length"),
        ("statics stack --push 1,0", "--push must be 3 numbers, not all zero, like 1,0,0; got '1,0'"),
        ("statics stack --push 0,0,0", "not all zero"),
        ("statics stack --push 1,nan,0", "--push must be 3 numbers"),
        ("statics pile(balls=5,planar=True) --push 1,0,0", "--push must be 2 numbers, not all zero, like 1,0"),
        ("statics woodpecker --push 1,0,0", "omit --push"),
        ("statics stack --friction", "no contact has friction"),
        ("statics", "SCENE"),
    ],
)
def test_errors_are_reported_in_one_sentence(line: str, words: str, mistake: Callable[[str], str]) -> None:
    assert words in mistake(line)


def test_quiet_gives_the_answer_as_exit_code_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["statics", "block_on_incline(slope=0.3)", "--quiet"]) == 0
    assert run_command(["statics", "block_on_incline(slope=0.3, friction=0.2)", "--quiet"]) == 1
    assert capsys.readouterr() == ("", "")
