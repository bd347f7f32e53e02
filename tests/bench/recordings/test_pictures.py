"""A still shows the end of a recording, and a film shows all of it; a failure prints one sentence."""

import os
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from proxbench.bench.cli.main import run_command
from proxbench.bench.recordings import headless
from proxbench.bench.recordings.pictures import FILM_SIZE, STILL_SIZE

RECORD = "record hard-sticking-box --solver SORprox --tolerance 1e-4"
DRIVERS = [
    *Path("/usr/share/vulkan/icd.d").glob("*.json"),
    *Path("/etc/vulkan/icd.d").glob("*.json"),
    *filter(None, [os.environ.get("VK_DRIVER_FILES")]),
]


@pytest.mark.slow
@pytest.mark.skipif(not DRIVERS, reason="this machine has no Vulkan driver")
def test_a_still_has_the_configured_size_and_title_bars_with_titles_and_no_buttons(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    line = f"{RECORD} --output {tmp_path}/a.rrd --still {tmp_path}/a.png"
    assert run_command(line.split()) == 0
    assert f"still: {tmp_path}/a.png" in capsys.readouterr().out
    picture = (tmp_path / "a.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert struct.unpack(">II", picture[16:24]) == STILL_SIZE
    assert len(picture) > 10_000  # an empty picture of this size compresses to less
    with Image.open(tmp_path / "a.png") as still:
        bar = np.asarray(still.convert("L"), dtype=int)[1:27]
    assert np.ptp(bar[:, 120:-1]) <= 8
    assert np.ptp(bar[:, 10:80]) > 100


@pytest.mark.slow
@pytest.mark.skipif(not DRIVERS, reason="this machine has no Vulkan driver")
def test_a_still_of_a_stored_simulation_is_drawn_from_its_result_alone(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, still = tmp_path / "a.npz", tmp_path / "a.png"
    line = f"simulate block_on_incline(speed=1.0) --duration 0.1 --output {file} --no-progress"
    assert run_command(line.split()) == 0
    assert run_command(["record", str(file), "--still", str(still)]) == 0
    assert f"still: {still}" in capsys.readouterr().out
    assert struct.unpack(">II", still.read_bytes()[16:24]) == STILL_SIZE


@pytest.mark.slow
@pytest.mark.skipif(not DRIVERS, reason="this machine has no Vulkan driver")
def test_a_film_shows_the_motion_from_start_to_end(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, film = tmp_path / "a.npz", tmp_path / "a.webp"
    line = f"simulate pendulum --stepper Moreau(step=0.05) --duration 0.5 --output {file} --no-progress"
    assert run_command(line.split()) == 0
    assert run_command(["record", str(file), "--film", str(film), "--frames", "3"]) == 0
    assert f"film: {film}" in capsys.readouterr().out
    with Image.open(film) as frames:
        assert (frames.n_frames, frames.size) == (3, FILM_SIZE)  # type: ignore[attr-defined]
        pictures = []
        for number in range(3):
            frames.seek(number)
            pictures.append(np.asarray(frames.convert("L"), dtype=int))
    assert (np.abs(np.diff(pictures, axis=0)) > 50).sum(axis=(1, 2)).min() > 500  # the rod moved
    assert pictures[0][1:27, 120:-1].max() <= 40  # no buttons, only compression noise


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        ("--still new.jpg", "must end in .png"),
        ("--film new.gif", "must end in .webp"),
        ("--film new.webp --frames 1", "--frames"),
        ("--still old.png", "--force"),
        ("--still old.png/new.png", "cannot write"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused_before_any_work(
    picture: str, words: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("old.png").write_text("precious")
    assert run_command(f"{RECORD} --output new.rrd {picture}".split()) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert words in printed.err
    assert [(path.name, path.read_text()) for path in Path().iterdir()] == [("old.png", "precious")]


@pytest.mark.slow
@pytest.mark.parametrize(("program", "remedy"), [("false", "mesa-vulkan-drivers"), (None, "reinstall rerun-sdk")])
def test_a_machine_that_cannot_draw_keeps_the_recording_and_gets_one_sentence(
    program: str | None,
    remedy: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = shutil.which(program) if program else None
    monkeypatch.setattr(headless.shutil, "which", lambda name, path: found)
    line = f"{RECORD} --output {tmp_path}/a.rrd --still {tmp_path}/a.png"
    assert run_command(line.split()) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert remedy in printed.err
    assert f"{tmp_path}/a.rrd is kept" in printed.err
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"]


@pytest.mark.slow
def test_a_slow_viewer_is_not_reported_as_a_missing_driver(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(headless, "PHASE_SECONDS", 0.0)
    line = f"{RECORD} --output {tmp_path}/a.rrd --still {tmp_path}/a.png"
    assert run_command(line.split()) == 2
    printed = capsys.readouterr().err
    assert f"{tmp_path}/a.rrd is kept, but the viewer cannot draw" in printed
    assert printed.endswith("repeat the command when the machine is less busy.\n")
