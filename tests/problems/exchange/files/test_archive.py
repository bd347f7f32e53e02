"""An untrusted problem file runs no code, takes no excessive memory, and is refused in one sentence."""

import io
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from proxbench.problems import ProblemError, load
from proxbench.problems.exchange.files.archive import MAX_ARCHIVE_BYTES, ArchiveError, read_arrays
from proxbench.problems.exchange.files.problem_file import problem_bytes, read_problem

WHOLE = problem_bytes(load("hard-sticking-box"))


class Trap:
    """Creates a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.folder),)


def rewritten(**changes: Any) -> bytes:
    """Return a problem file with some of its arrays replaced."""
    arrays = {**read_arrays(io.BytesIO(WHOLE)), **changes}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def zipped(*members: tuple[str, bytes]) -> io.BytesIO:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return buffer


def header(shape: str, descr: str = "<f8") -> bytes:
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def test_a_pickle_is_refused_and_not_run(tmp_path: Path) -> None:
    objects = np.empty(1, dtype=object)
    objects[0] = Trap(tmp_path / "sprung")
    file = tmp_path / "p.npz"
    for content in (rewritten(c=objects), pickle.dumps(Trap(tmp_path / "sprung"))):
        file.write_bytes(content)
        with pytest.raises(ProblemError, match=r"p\.npz is damaged"):
            read_problem(file)
        assert not (tmp_path / "sprung").exists()


def test_an_archive_beyond_the_size_limit_is_refused_before_it_is_unpacked() -> None:
    block = bytes(2**24)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for number in range(3):
            with archive.open(f"{number}.npy", "w", force_zip64=True) as member:
                for _ in range(MAX_ARCHIVE_BYTES // len(block) // 16):
                    member.write(block)
        for member_info in archive.infolist():
            member_info.file_size = MAX_ARCHIVE_BYTES // 2
    with pytest.raises(ArchiveError, match="exceed the limits of problem files"):
        read_arrays(buffer)


@pytest.mark.parametrize(
    "members",
    [
        [("c.npy", header("(1000000000000,)"))],
        [("c.npy", header("(-1,)"))],
        [("c.npy", header("(3,)", "|O") + b"cbuiltins\nlist\n.")],
        [("c.npy", header("(" * 500 + ")" * 500))],
        [("c.npy", b"\x93NUMPY\x09\x00" + b" " * 100)],
        [("c.npy", b"no array")],
        [("c.npy", header("(1,)") + bytes(8)), ("c", header("(1,)") + bytes(8))],
        [(f"{number}.npy", header("(0,)")) for number in range(1000)],
    ],
)
def test_archive_with_false_sizes_is_rejected(members: list[tuple[str, bytes]]) -> None:
    with pytest.raises(ArchiveError):
        read_arrays(zipped(*members))


@pytest.mark.parametrize(
    "changes",
    [
        {"partner": np.array([10**9] * 2, dtype=np.int32)},
        {"about": np.frombuffer(b"[" * 100_000, dtype=np.uint8)},
        {"about": np.frombuffer(b"null", dtype=np.uint8)},
        {"c": np.array(["a", "b", "c"])},
        {"c": np.array(1.0)},
    ],
)
def test_content_that_makes_no_sense_is_refused(changes: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(ProblemError):
        read_problem(io.BytesIO(rewritten(**changes)), "p.npz")


def test_indices_outside_a_matrix_are_refused() -> None:
    arrays = read_arrays(io.BytesIO(WHOLE))
    label = next(key.removesuffix(".indices") for key in arrays if key.endswith(".indices"))
    for part in ("indices", "indptr", "shape"):
        wild = arrays[f"{label}.{part}"].copy()
        wild[-1] = 2**30
        with pytest.raises(ProblemError):
            read_problem(io.BytesIO(rewritten(**{f"{label}.{part}": wild})), "p.npz")


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 8 * len(WHOLE) - 1), st.integers(0, len(WHOLE)))
def test_a_flipped_bit_or_truncation_is_refused_or_does_not_change_the_problem(bit: int, end: int) -> None:
    flipped = bytearray(WHOLE)
    flipped[bit // 8] ^= 1 << bit % 8
    for content in (bytes(flipped), WHOLE[:end]):
        said = ""
        try:
            found = read_problem(io.BytesIO(content), "p.npz")
        except ProblemError as error:
            said = str(error)
        assert said.startswith("p.npz ") if said else found.digest == load("hard-sticking-box").digest
        assert "\n" not in said
