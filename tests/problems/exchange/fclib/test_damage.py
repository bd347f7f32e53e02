"""Damaged files are refused in one sentence or read as written: no crash, no hang, no other numbers.

A file of another program has no checksum, so a changed number that is still valid gives another problem.
"""

import os
import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from handmade_fclib import Data, global_data, global_jointed_data, jointed_data, rolling_data, write_data
from proxbench.problems import ContactProblem, ProblemError, load, read_fclib, write_fclib

MUTATIONS = [50, pytest.param(1000 if os.environ.get("PROXBENCH_PROFILE") == "full" else 250, marks=pytest.mark.weekly)]
"""Numbers of damaged files; each number gives different damage."""
METADATA = re.compile(rb"TREE|HEAP|SNOD|\x89HDF|\x01\x00.\x00\x01\x00\x00\x00", re.DOTALL)
"""Beginnings of the parts of a file's structure: signatures, and headers of data sets and groups."""


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the file truncated, with flipped bits anywhere, or with other bytes in its structure."""
    chance, changed = rng.random(), bytearray(content)
    if chance < 0.25:
        return content[: rng.integers(len(content))]
    if chance < 0.6:
        for _ in range(rng.integers(1, 9)):
            changed[rng.integers(len(changed))] ^= 1 << rng.integers(8)
        return bytes(changed)
    starts = [found.start() for found in METADATA.finditer(content)]
    for _ in range(rng.integers(1, 5)):
        place = min(rng.choice(starts) + rng.integers(96), len(content) - 1)
        changed[place] = rng.choice([0, 255, rng.integers(256)])
    return bytes(changed)


def outcome(path: Path) -> str:
    try:
        return read_fclib(path).digest
    except ProblemError as error:
        sentence = str(error)
    assert sentence.startswith(str(path))
    assert "\n" not in sentence
    return "refused"


@pytest.mark.parametrize("mutations", MUTATIONS)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("hard-sticking-box", marks=pytest.mark.weekly),
        "hard-linked-2-axes",
        pytest.param("hard-four-bar-redundant", marks=pytest.mark.weekly),
    ],
)
def test_damaged_proxbench_files_never_load_other_data(name: str, mutations: int, tmp_path: Path) -> None:
    path, rng = tmp_path / "p.hdf5", np.random.default_rng((14, mutations))
    write_fclib(load(name), path)
    content, digest = path.read_bytes(), read_fclib(path).digest
    outcomes = []
    for _ in range(mutations):
        path.write_bytes(mutated(content, rng))
        outcomes.append(outcome(path))
    assert set(outcomes) == {"refused", digest}
    assert outcomes.count("refused") > mutations / 3


@pytest.mark.parametrize("mutations", MUTATIONS)
@pytest.mark.parametrize(
    "data",
    [
        pytest.param(global_data(), marks=pytest.mark.weekly, id="contacts"),
        pytest.param(jointed_data(), id="joints"),
        pytest.param(rolling_data(), marks=pytest.mark.weekly, id="rolling"),
    ],
)
def test_damage_to_a_file_from_elsewhere_is_refused_or_gives_another_valid_problem(
    data: Data, mutations: int, tmp_path: Path
) -> None:
    path, rng = tmp_path / "p.hdf5", np.random.default_rng((15, mutations))
    content = write_data(path, data).read_bytes()
    for _ in range(mutations):
        path.write_bytes(mutated(content, rng))
        outcome(path)


def test_a_number_changed_in_a_file_of_ours_is_noticed(tmp_path: Path) -> None:
    problem = load("hard-sticking-box")
    write_fclib(problem, tmp_path / "p.hdf5")
    content = (tmp_path / "p.hdf5").read_bytes()
    friction = problem.laws.friction_coefficient[1::2].tobytes()
    assert content.count(friction) == 1
    at = content.index(friction)
    (tmp_path / "p.hdf5").write_bytes(content[:at] + b"\x01" + content[at + 1 :])
    with pytest.raises(ProblemError, match=r"p\.hdf5 is damaged: its numbers do not match its digest"):
        read_fclib(tmp_path / "p.hdf5")


def peak_of_reading(path: Path) -> int:
    """Return the largest additional memory that reading takes [bytes]."""
    outcome(path)  # imports and compilation do not count
    tracemalloc.start()
    outcome(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.parametrize("name", ["m", "n", "nz", "nzmax"])
@pytest.mark.parametrize("label", ["M", "H", "G"])
def test_false_array_size_allocates_no_memory(label: str, name: str, tmp_path: Path) -> None:
    claims = {f"fclib_global/{label}/{name}": np.array([2**31 - 1])}
    assert peak_of_reading(write_data(tmp_path / "p.hdf5", global_jointed_data(), **claims)) < 100_000


def test_reading_takes_at_most_three_times_the_memory_of_the_file_and_six_for_a_delassus_matrix(tmp_path: Path) -> None:
    problem = load("pile-300")
    assembled = ContactProblem(problem.free_velocity, problem.laws, matrix=problem.delassus())
    for made, times in ((problem, 3.0), (assembled, 6.0)):
        write_fclib(made, tmp_path / "p.hdf5")
        assert peak_of_reading(tmp_path / "p.hdf5") < times * (tmp_path / "p.hdf5").stat().st_size
