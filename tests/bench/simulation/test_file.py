"""Result files contain the whole simulation, and incomplete files are refused with one sentence."""

import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib.recfunctions import repack_fields
from proxbench.bench.errors import BenchError
from proxbench.bench.simulation.file import read_simulation
from proxbench.bench.simulation.plan import SimulationPlan, make_simulation_plan
from proxbench.bench.simulation.run import resume_simulation, simulate
from proxbench.bench.simulation.simulation import LAW_STATES, LAWS
from proxbench.problems import load
from proxbench.problems.exchange.files.problem_file import save_problem

Pour = Callable[..., SimulationPlan]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result file of a pour, which all tests read and none changes."""
    file = tmp_path_factory.mktemp("simulated") / "stored.npz"
    simulate(make_simulation_plan("pile", {"balls": 10}, stepper="Moreau(step=1e-3)", duration=0.15), file)
    return file


@pytest.fixture
def stored(simulated: Path, tmp_path: Path) -> Path:
    """A copy of the file, to which the test may write."""
    return Path(shutil.copy(simulated, tmp_path))


def rewritten(file: Path, **changes: Any) -> None:
    with np.load(file, allow_pickle=False) as arrays:
        content = {name: arrays[name] for name in arrays.files}
    content.update(changes)
    with file.open("wb") as target:
        np.savez(target, **{name: array for name, array in content.items() if array is not None})


def assert_refused(file: Path, words: str) -> None:
    with pytest.raises(BenchError) as caught:
        read_simulation(file)
    assert words in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_holds_plan_steps_and_state_without_pickle(pour: Pour, tmp_path: Path) -> None:
    simulation = simulate(pour(150), tmp_path / "a.npz")
    again = read_simulation(tmp_path / "a.npz")
    assert again.plan.record == simulation.plan.record
    assert again.steps.tobytes() == simulation.steps.tobytes()
    assert again.wall_seconds == simulation.wall_seconds
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        assert archive.testzip() is None
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        states = {"times", "marks", "positions", "velocities", "contacts", "keys", "impulses"}
        assert set(arrays.files) == {
            "about",
            "steps",
            "switches",
            "closed",
            "sticking",
            *(f"state_{name}" for name in states),
        }
        assert not any(arrays[name].dtype.hasobject for name in arrays.files)


def test_a_byte_changed_in_any_array_is_noticed(stored: Path) -> None:
    content = stored.read_bytes()
    with zipfile.ZipFile(stored) as archive:
        places = [entry.header_offset + 30 + len(entry.filename) + entry.file_size for entry in archive.infolist()]
    for place in places:
        damaged = bytearray(content)
        damaged[place] ^= 0x40
        stored.write_bytes(bytes(damaged))
        assert_refused(stored, "is damaged")


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_a_file_cut_short_is_noticed(stored: Path, share: float) -> None:
    content = stored.read_bytes()
    stored.write_bytes(content[: int(share * len(content))])
    assert_refused(stored, "is damaged")


def test_files_of_other_programs_are_recognised(tmp_path: Path) -> None:
    file = tmp_path / "other.npz"
    for content in (b"", b"hello", b"\x93NUMPY"):
        file.write_bytes(content)
        assert_refused(file, "not a result file of a simulation")
    save_problem(load("hard-no-motion"), file)
    assert_refused(file, "not a result file of a simulation")
    assert_refused(tmp_path / "nowhere.npz", "there is no result file")
    assert_refused(tmp_path, "is a folder; name a result file in it")


@pytest.mark.parametrize(
    "changes",
    [
        {"state_positions": np.zeros(3)},
        {"state_velocities": None},
        {"state_keys": np.zeros(1, dtype=np.int64)},
        {"state_times": np.array([0.0, 5.0])},
        {"steps": np.zeros(4)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_inconsistent_arrays_are_refused(stored: Path, changes: dict[str, Any]) -> None:
    rewritten(stored, **changes)
    assert_refused(stored, "is damaged")


def test_a_variable_step_is_stored_in_the_same_file_with_its_switching_points(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    simulation = simulate(make_simulation_plan("woodpecker(start='cycle')", duration=0.01), file)
    again = read_simulation(file)
    assert len(again.switches) > 0
    assert again.switches.tobytes() == simulation.switches.tobytes()
    assert again.law_states is not None
    assert simulation.law_states is not None
    assert again.law_states.closed == simulation.law_states.closed


def test_stored_indices_keep_their_meaning() -> None:
    assert LAWS == ("unilateral", "friction")
    assert LAW_STATES == ("open", "closed", "stick", "slip")


def test_invalid_switching_point_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    switches = simulate(make_simulation_plan("woodpecker(start='cycle')", duration=0.01), file).switches.copy()
    switches["after"] = 99
    rewritten(file, switches=switches)
    assert_refused(file, "is damaged")


def test_a_state_that_is_not_finite_is_noticed(stored: Path) -> None:
    positions = np.array([state.position for state in read_simulation(stored).states])
    positions[-1, 0] = np.nan
    rewritten(stored, state_positions=positions)
    assert_refused(stored, "is damaged")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 99}, "has format 99"),
        ({"format": 5}, "has format 5, this version reads formats 6 and 7; simulate again"),
        (
            {"kind": "proxbench simulation with variable steps", "format": 2},
            "has format 2, this version reads formats 6 and 7",
        ),
        ({"plan": {"scene": "avalanche"}}, "is damaged"),
        ({"statuses": []}, "is damaged"),
    ],
)
def test_unsupported_or_damaged_header_is_refused(stored: Path, change: dict[str, Any], words: str) -> None:
    with np.load(stored) as arrays:
        about = json.loads(arrays["about"].tobytes())
    about.update(change)
    rewritten(stored, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8))
    assert_refused(stored, words)


def test_a_file_of_format_6_is_continued_and_its_overlaps_are_unknown(stored: Path) -> None:
    with np.load(stored) as arrays:
        about, steps = json.loads(arrays["about"].tobytes()), arrays["steps"]
    older = repack_fields(steps[[name for name in steps.dtype.names if name != "overlap"]])
    about["format"] = 6
    rewritten(stored, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8), steps=older)
    read = read_simulation(stored)
    assert np.isnan(read.steps["overlap"]).all()
    assert all(read.steps[name].tobytes() == steps[name].tobytes() for name in older.dtype.names)
    resumed = resume_simulation(stored, duration=0.2)
    again = read_simulation(stored)
    assert again.n_steps == resumed.n_steps > len(steps)
    assert np.isnan(again.steps["overlap"]).sum() == len(steps)


def test_unknown_scene_in_a_file_is_reported(stored: Path) -> None:
    with np.load(stored) as arrays:
        about = json.loads(arrays["about"].tobytes())
    about["plan"]["scene"] = "avalanche"
    rewritten(stored, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8))
    assert_refused(stored, "there is no scene 'avalanche'")
