"""``proxbench simulate`` with a variable step."""

import json
from pathlib import Path

import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.simulation.file import read_simulation, write_simulation
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.simulation.simulation import Simulation

TOY = "simulate woodpecker(start='cycle') --no-progress"


@pytest.mark.slow
def test_the_woodpecker_prints_the_published_table_and_draws_its_figure(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    assert run_command(f"{TOY} --duration 0.3 --output {tmp_path}/toy.npz".split()) == 0
    printed = capsys.readouterr().out
    assert "2 lower edge" in printed
    assert "complete period 1 of 1, as in table 1 of the paper" in printed
    assert "1 of 1 complete period, from row 1 to the next row 1, " in printed
    assert "12 switching points of table 1 of the paper" in " ".join(printed.split())
    assert "one-step solves" in printed
    assert {file.name for file in tmp_path.iterdir()} == {"toy.npz", "toy.svg", "toy.png"}
    drawing = (tmp_path / "toy.svg").read_text(encoding="utf-8")
    assert "sleeve angle [rad]" in drawing
    assert "step size [s]" in drawing


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_json_option_prints_only_the_document(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command(f"{TOY} --duration 0.01 --json --output {tmp_path}/toy.npz".split()) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["summary"]["finished"]
    switch = document["switches"][0]
    assert switch["law"] == "unilateral"
    assert switch["begin"] < switch["time"] < switch["end"]


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_stored_simulation_goes_on_with_a_longer_duration(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.005 --output {file}".split()) == 0
    assert run_command(f"simulate --resume {file} --duration 0.01 --no-progress".split()) == 0
    assert read_simulation(file).state.time == pytest.approx(0.01)


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_balls_can_have_a_variable_step_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    stepper = "Extrapolated(tolerance=1e-4,min_step=1e-6)"
    line = f"simulate pile(balls=2) --duration 0.25 --no-progress --output {tmp_path}/balls.npz --stepper {stepper}"
    assert run_command(line.split()) == 0
    assert "unilateral" in capsys.readouterr().out


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_fixed_step_is_taken_where_its_size_is_given(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert run_command(f"{TOY} --duration 0.01 --stepper Moreau(step=1e-4) --output {tmp_path}/toy.npz".split()) == 0
    assert "Moreau(step=0.0001)" in capsys.readouterr().out


@pytest.mark.weekly
def test_the_figure_of_many_short_steps_is_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    stepper = "StepDoubling(tolerance=1e-4,min_step=1e-6,max_step=2e-5)"
    assert run_command(f"{TOY} --duration 0.02 --stepper {stepper} --output {tmp_path}/toy.npz".split()) == 0
    assert read_simulation(tmp_path / "toy.npz").n_steps > 700
    assert (tmp_path / "toy.png").is_file()


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_fixed_step_is_not_resumed_with_a_variable_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.01 --stepper Moreau(step=1e-4) --output {file}".split()) == 0
    assert run_command(f"simulate --resume {file} --stepper Extrapolated --duration 0.02".split()) == 2
    assert "stepper Extrapolated contradicts" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            "woodpecker(friction=0.2)",
            "friction 0.2 contradicts {file}, which has friction 0.3; omit it to resume.",
        ),
        (
            "woodpecker(balls=3)",
            "the scene 'woodpecker' has no option 'balls'; known are friction, gravity, restitution, start.",
        ),
        ("pile", "scene pile contradicts {file}, which has scene woodpecker; omit it to resume."),
        (
            "woodpecker(friction=None)",
            "friction off contradicts {file}, which has friction 0.3; omit it to resume.",
        ),
    ],
)
def test_options_that_contradict_a_stored_simulation_are_reported_with_the_stored_values(
    options: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "toy.npz"
    write_simulation(Simulation(make_simulation_plan("woodpecker")), file)
    assert run_command(f"simulate --resume {file} {options}".split()) == 2
    assert (
        capsys.readouterr().err
        == f"proxbench: {words.format(file=file, options='friction, gravity, restitution, start')}\n"
    )


@pytest.mark.parametrize("name", ["there", "there.json"])
def test_a_folder_that_is_no_run_is_not_resumed(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    assert run_command(["simulate", "--resume", str(tmp_path / name)]) == 2
    assert f"{name} is not a stored run (it has no run.json); name the folder of a run." in capsys.readouterr().err


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.slow
def test_a_variable_step_is_not_resumed_with_a_fixed_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "toy.npz"
    assert run_command(f"{TOY} --duration 0.005 --output {file}".split()) == 0
    before = file.read_bytes()
    capsys.readouterr()
    assert run_command(f"simulate --resume {file} --stepper Moreau --duration 0.02".split()) == 2
    said = f"stepper Moreau(step=2e-05) contradicts {file}, which has stepper Extrapolated; omit it to resume."
    assert capsys.readouterr().err == f"proxbench: {said}\n"
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--stepper nonsense", "known are EventDriven, Extrapolated, Moreau, StepDoubling"),
        ("--stepper moreau", "did you mean 'Moreau'?"),
        ("--stepper Extrapolatde", "there is no stepper 'Extrapolatde'"),
        ("--stepper Moreau(step_size=1e-3)", "Moreau has no option 'step_size'; did you mean 'step'?"),
        ("--stepper Extrapolated(max_step=0.0)", "max_step must be finite and at least min_step"),
        ("--stepper Extrapolated(min_step=0.5)", "max_step must be finite and at least min_step"),
        ("--duration -1", "--duration must be positive and finite, got -1; omit it"),
        ("--duration inf", "--duration must be positive and finite, got inf; omit it"),
        ("--stepper Extrapolated(min_step=1e-30)", "too short to separate times"),
        ("--solver Unknown", "Unknown"),
    ],
)
def test_invalid_input_is_reported_in_one_sentence_and_leaves_no_file(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: str, words: str
) -> None:
    assert run_command(f"{TOY} {options} --output {tmp_path}/toy.npz".split()) == 2
    printed = capsys.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1
    assert not list(tmp_path.iterdir())
