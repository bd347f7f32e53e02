"""``proxbench simulate`` with a variable step."""

import json
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.variable.file import read_variable, write_variable
from proxbench.bench.variable.plan import make_variable_plan
from proxbench.bench.variable.simulation import VariableSimulation

TOY = "simulate woodpecker --start cycle --no-progress"


def test_the_woodpecker_prints_the_published_table_and_draws_its_figure(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run_command(f"{TOY} --duration 0.3 --output {tmp_path}/toy.npz".split()) == 0
    printed = capsys.readouterr().out
    assert "2 lower edge" in printed
    assert "complete period 1 of 1, as table 1 of the paper" in printed
    assert "1 of 1 complete period, from row 1 to the next row 1, has the twelve switching points of table 1" in printed
    assert "one-step solves" in printed
    assert {file.name for file in tmp_path.iterdir()} == {"toy.npz", "toy.svg", "toy.png"}
    drawing = (tmp_path / "toy.svg").read_text(encoding="utf-8")
    assert "sleeve angle [rad]" in drawing
    assert "step size [s]" in drawing


def test_json_is_all_that_is_printed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command(f"{TOY} --duration 0.01 --json --output {tmp_path}/toy.npz".split()) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["summary"]["finished"]
    incident = document["incidents"][0]
    assert incident["law"] == "unilateral"
    assert incident["begin"] < incident["time"] < incident["end"]


def test_a_stored_simulation_goes_on_with_a_longer_duration(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.005 --output {file}".split()) == 0
    assert run_command(f"simulate --resume {file} --duration 0.01 --no-progress".split()) == 0
    assert read_variable(file).state.time == pytest.approx(0.01)


def test_balls_can_have_a_variable_step_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    stepper = "Extrapolated(tolerance=1e-4,min_step=1e-6)"
    line = f"simulate pile --balls 2 --duration 0.25 --no-progress --output {tmp_path}/balls.npz --stepper {stepper}"
    assert run_command(line.split()) == 0
    assert "unilateral" in capsys.readouterr().out


def test_a_fixed_step_is_taken_where_its_size_is_given(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command(f"{TOY} --duration 0.01 --step-size 1e-4 --output {tmp_path}/toy.npz".split()) == 0
    assert "Δt 0.0001 s" in capsys.readouterr().out


def test_the_figure_of_many_short_steps_is_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    stepper = "StepDoubling(tolerance=1e-4,min_step=1e-6,max_step=2e-5)"
    assert run_command(f"{TOY} --duration 0.02 --stepper {stepper} --output {tmp_path}/toy.npz".split()) == 0
    assert read_variable(tmp_path / "toy.npz").n_steps > 700
    assert (tmp_path / "toy.png").is_file()


def test_a_fixed_step_is_not_resumed_with_a_variable_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.01 --step-size 1e-4 --output {file}".split()) == 0
    assert run_command(f"simulate --resume {file} --stepper Extrapolated --duration 0.02".split()) == 2
    assert "has a fixed step; leave it out to resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            "woodpecker --friction 0.2",
            "friction 0.2 contradicts {file}, which has friction 0.3; leave it out to resume.",
        ),
        ("--balls 3", "balls 3 contradicts {file}, which has no balls; leave it out to resume."),
        ("pile", "scene pile contradicts {file}, which has scene woodpecker; leave it out to resume."),
        ("--no-friction", "friction off contradicts {file}, which has friction 0.3; leave it out to resume."),
    ],
)
def test_what_contradicts_a_stored_variable_step_is_named_beside_what_is_stored(
    asked: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "toy.npz"
    write_variable(VariableSimulation(make_variable_plan("woodpecker")), file)
    assert run_command(f"simulate --resume {file} {asked}".split()) == 2
    assert capsys.readouterr().err == f"proxbench: {words.format(file=file)}\n"


@pytest.mark.parametrize("name", ["there", "there.json"])
def test_a_folder_is_no_result_file(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    assert run_command(["simulate", "--resume", str(tmp_path / name)]) == 2
    assert f"{name} is a folder; name a " in capsys.readouterr().err


def test_a_variable_step_is_not_resumed_with_a_fixed_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.005 --output {file}".split()) == 0
    before = file.read_bytes()
    capsys.readouterr()
    assert run_command(f"simulate --resume {file} --stepper Moreau --duration 0.02".split()) == 2
    said = "has a variable step and cannot go on with a fixed one; leave --stepper out, or simulate anew."
    assert capsys.readouterr().err == f"proxbench: {file} {said}\n"
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--stepper nonsense", "known are Extrapolated, Moreau, StepDoubling"),
        ("--stepper moreau", "did you mean 'Moreau'?"),
        ("--stepper Extrapolatde", "there is no stepper 'Extrapolatde'"),
        ("--stepper Extrapolated --step-size 1e-3", "--step-size belongs to --stepper Moreau"),
        ("--stepper Extrapolated(max_step=0.0)", "max_step must be finite and at least min_step"),
        ("--stepper Extrapolated(min_step=0.5)", "max_step must be finite and at least min_step"),
        ("--duration -1", "duration must be positive and finite, got -1.0 s"),
        ("--duration inf", "duration must be positive and finite, got inf s"),
        ("--stepper Extrapolated(min_step=1e-30)", "too short to tell times"),
        ("--solver Nobody", "Nobody"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: str, words: str
) -> None:
    assert run_command(f"{TOY} {options} --output {tmp_path}/toy.npz".split()) == 2
    printed = capsys.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1
    assert not list(tmp_path.iterdir())
