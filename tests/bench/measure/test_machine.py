"""The record of a machine contains the version of every library whose solvers, captures or contacts may be measured."""

import os
import re
import shutil
import subprocess
from collections import namedtuple
from importlib import metadata
from pathlib import Path

import pytest
from proxbench.bench.measure import machine

EXTRAS = ("peers", "kamino", "mujoco", "bodies")


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_libraries_of_an_extra_are_among_the_versions(extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    required = [
        text for text in metadata.requires("proxbench") or [] if re.search(rf"extra == ['\"]{extra}['\"]", text)
    ]
    names = {re.match(r"[\w-]+", text).group() for text in required}  # type: ignore[union-attr]
    monkeypatch.setattr(machine.metadata, "version", lambda name: "1.0")
    assert names
    assert names <= set(machine.this_machine().versions)


def test_only_installed_libraries_have_a_version() -> None:
    versions = machine.this_machine().versions
    assert "numpy" in versions
    assert all(versions.values())


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_reading_the_state_of_a_checkout_writes_nothing_into_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run killed during such a write would leave a locked index."""
    source, index = tmp_path / "machine.py", tmp_path / ".git" / "index"
    source.write_text("")
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    for words in (("init", "--quiet"), ("add", "."), (*identity, "commit", "--quiet", "--message", "one")):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    os.utime(source, (1, 1))  # git would write its new time to the index
    before = index.read_bytes()
    monkeypatch.setattr(machine, "__file__", str(source))
    assert len(machine._git("rev-parse", "HEAD")) == 40
    assert machine._git("status", "--porcelain") == ""
    assert index.read_bytes() == before


@pytest.mark.parametrize("has_iowait", [True, False])
def test_waiting_core_is_not_busy(has_iowait: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cores work for 3 s and 5 s; the first one is omitted. Only Linux counts the time that a core waits."""
    names = ("user", "system", "idle", "iowait") if has_iowait else ("user", "system", "idle")
    times = namedtuple("times", names)  # type: ignore[misc]
    cores = [times(*seconds[: len(names)]) for seconds in ((2.0, 1.0, 7.0, 4.0), (4.0, 1.0, 9.0, 2.0))]
    monkeypatch.setattr(machine.psutil, "cpu_times", lambda percpu: cores)
    assert machine.busy_seconds({0}) == 5.0
    assert machine.busy_seconds(set()) == 0.0
