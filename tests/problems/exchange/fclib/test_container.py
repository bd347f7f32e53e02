"""Only plain arrays of the file itself are read, and nothing larger than the file."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from proxbench.problems.exchange.fclib import container
from proxbench.problems.exchange.fclib.container import ContainerError, Group, open_container

Look = Callable[[Group], Any]


def secret(folder: Path) -> Path:
    """Return a file elsewhere that must not be read."""
    path = folder / "secret.hdf5"
    with h5py.File(path, "w") as file:
        file["v"] = np.arange(4.0)
        file.create_group("g")["v"] = np.arange(4.0)
    (folder / "secret.bin").write_bytes(np.arange(4.0).tobytes())
    return path


def external_link(file: h5py.File, folder: Path) -> None:
    file["v"] = h5py.ExternalLink(str(secret(folder)), "/v")


def soft_link(file: h5py.File, folder: Path) -> None:
    file["w"] = np.arange(4.0)
    file["v"] = h5py.SoftLink("/w")


def dangling_link(file: h5py.File, folder: Path) -> None:
    file["v"] = h5py.SoftLink("/nowhere")


def external_storage(file: h5py.File, folder: Path) -> None:
    secret(folder)
    file.create_dataset("v", (4,), np.float64, external=[(str(folder / "secret.bin"), 0, 32)])


def virtual(file: h5py.File, folder: Path) -> None:
    layout = h5py.VirtualLayout((4,), np.float64)
    layout[:] = h5py.VirtualSource(str(secret(folder)), "v", (4,))
    file.create_virtual_dataset("v", layout)


def claimed(file: h5py.File, folder: Path) -> None:
    file.create_dataset("v", (2**60,), np.float64, chunks=(2**20,))


def packed_bomb(file: h5py.File, folder: Path) -> None:
    file.create_dataset("v", data=np.zeros(2**20), compression="gzip")


def reserved(file: h5py.File, folder: Path) -> None:
    file.create_dataset("v", (2**50,), np.float64)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (external_link, "/v is a link, and links are not followed"),
        (soft_link, "/v is a link"),
        (dangling_link, "/v is a link"),
        (external_storage, "keeps its data in other files"),
        (virtual, "keeps its data in other files"),
        (claimed, "is chunked or compressed, and FCLIB files are not; write it again with: h5repack"),
        (packed_bomb, "chunked or compressed"),
        (reserved, "/v has no data: its space was reserved, but not written"),
    ],
)
def test_links_external_data_and_unwritten_data_are_refused(
    make: Callable[[h5py.File, Path], None], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "f.hdf5"
    with h5py.File(path, "w") as file:
        make(file, tmp_path)
    with pytest.raises(ContainerError, match=words), open_container(path) as root:
        root.floats("v")


def test_a_group_behind_a_link_to_another_file_is_not_entered(tmp_path: Path) -> None:
    path = tmp_path / "f.hdf5"
    with h5py.File(path, "w") as file:
        file["g"] = h5py.ExternalLink(str(secret(tmp_path)), "/g")
    with pytest.raises(ContainerError, match="/g is a link"), open_container(path) as root:
        root.group("g")


@pytest.mark.parametrize(
    ("value", "look", "words"),
    [
        (np.zeros(3, dtype=np.float32), lambda root: root.floats("v"), "must contain 64-bit numbers"),
        (np.zeros(3, dtype=np.int32), lambda root: root.floats("v"), "must contain 64-bit numbers"),
        (np.zeros((3, 3)), lambda root: root.floats("v"), "must be a vector"),
        (np.zeros(3), lambda root: root.integers("v"), "must contain integers"),
        (np.zeros(3, dtype=np.int16), lambda root: root.integers("v"), "must contain integers"),
        (np.zeros(3, dtype=np.int32), lambda root: root.integer("v"), "must be one number, got 3"),
        (b"text", lambda root: root.floats("v"), "must contain 64-bit numbers"),
        (np.zeros(3), lambda root: root.text("v"), "must be one string"),
        (np.zeros(3), lambda root: root.group("v"), "/v is not a group"),
        (np.zeros(3), lambda root: root.group("elsewhere"), "/elsewhere is missing"),
        (np.zeros(3), lambda root: root.floats("elsewhere"), "/elsewhere is missing"),
    ],
)
def test_another_type_or_shape_is_refused(value: Any, look: Look, words: str, tmp_path: Path) -> None:
    path = tmp_path / "f.hdf5"
    with h5py.File(path, "w") as file:
        file["v"] = value
    with pytest.raises(ContainerError, match=words), open_container(path) as root:
        look(root)


def test_numbers_of_either_byte_order_and_length_are_read(tmp_path: Path) -> None:
    path = tmp_path / "f.hdf5"
    with h5py.File(path, "w") as file:
        for order in "<>":
            file[f"f8{order}"] = np.array([1.5, -2.0], dtype=f"{order}f8")
            file[f"i4{order}"] = np.array([7, -2], dtype=f"{order}i4")
            file[f"i8{order}"] = np.array([2**40, -2], dtype=f"{order}i8")
        file["scalar"] = np.int32(5)
        file["none"] = np.zeros(0)
    with open_container(path) as root:
        for order in "<>":
            assert root.floats(f"f8{order}").tolist() == [1.5, -2.0]
            assert root.integers(f"i4{order}").tolist() == [7, -2]
            assert root.integers(f"i8{order}").tolist() == [2**40, -2]
        assert root.integer("scalar") == 5
        assert root.floats("none").shape == (0,)


def test_texts_are_one_printable_line_of_limited_length(tmp_path: Path) -> None:
    path = tmp_path / "f.hdf5"
    with h5py.File(path, "w") as file:
        file["fixed"] = np.bytes_("\nBox stacks\n\x1b]0;owned\x07h=0.01\n")
        file["variable"] = "Kästen, \u202eweit"
        file["long"] = "x" * 100_000
        file["bytes"] = np.bytes_(b"\xff\xfe")
    with open_container(path) as root:
        assert root.text("fixed") == "Box stacks ]0;ownedh=0.01"
        assert root.text("variable") == "Kästen, weit"
        assert len(root.text("long")) == container.MAX_TEXT_LENGTH
        assert root.text("bytes").isprintable()
        assert root.text("none") == ""


def test_files_other_than_regular_hdf5_files_are_refused_without_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "text.hdf5").write_text("no HDF5")
    (tmp_path / "empty.hdf5").write_bytes(b"")
    (tmp_path / "folder.hdf5").mkdir()
    os.mkfifo(tmp_path / "pipe.hdf5")  # opening it would wait for a writer
    for name, words in (
        ("text", "not an HDF5 file"),
        ("empty", "not an HDF5 file"),
        ("folder", "not a regular file"),
        ("pipe", "not a regular file"),
    ):
        with pytest.raises(ContainerError, match=words), open_container(tmp_path / f"{name}.hdf5"):
            pass
    with pytest.raises(FileNotFoundError), open_container(tmp_path / "none.hdf5"):
        pass
    monkeypatch.setattr(container, "MAX_FILE_BYTES", 5)
    with pytest.raises(ContainerError, match="exceed the limit"), open_container(tmp_path / "text.hdf5"):
        pass
