"""Whatever happens to disk, folder and clock, what is finished stays, and the run can be finished later."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any

import pytest
from proxbench.bench import load, resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from sandbox import Sandbox, verdicts

SMALL = "['hard-sticking-box', 'hard-tresca-joint', 'funnel-30'], ['SORprox', 'ClarabelSOCP'], tolerances=[1e-1, 1e-3]"


def failing(sandbox: Sandbox, folder: Path, before: Callable[[], None] | None = None) -> str:
    """Run into a fault of the disk; return the sentence that names it."""
    done = sandbox.run(f"run({SMALL}, results={str(folder.parent)!r}, run_id={folder.name!r})", before)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("proxbench.bench.errors.BenchError: cannot write")
    return last


def finished(sandbox: Sandbox, folder: Path) -> dict[tuple[str, str], Any]:
    done = sandbox.run(f"resume({str(folder)!r})")
    assert done.returncode == 0, done.stderr
    assert sandbox.left_behind() == []
    return verdicts(folder)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    sandbox = Sandbox(tmp_path_factory.mktemp("undisturbed"))
    done = sandbox.run(f"run({SMALL}, results={str(sandbox.results)!r}, run_id='it')")
    assert done.returncode == 0, done.stderr
    return sandbox.results / "it"


def test_a_file_that_finds_no_room_stops_the_run_and_costs_nothing_finished(
    sandbox: Sandbox, undisturbed: Path
) -> None:
    sizes = sorted(file.stat().st_size for file in undisturbed.rglob("*.json"))
    folder = sandbox.results / "it"

    def allow_little() -> None:
        _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (sizes[-1] // 2, most))

    assert "File too large" in failing(sandbox, folder, allow_little)
    assert sandbox.left_behind() == []
    assert 1 <= len(list((folder / "cases").iterdir())) < 6
    assert finished(sandbox, folder) == verdicts(undisturbed)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 kB; who may not mount one goes without this test."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no right to mount a file system")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk_and_a_read_only_one(
    sandbox: Sandbox, undisturbed: Path, small_disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_disk / "it"
    assert "No space left" in failing(sandbox, folder)
    assert not list(folder.rglob("*.part"))
    assert load(folder).damaged == []
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    with pytest.raises(BenchError, match=r"cannot write .* Read-only file system"):
        resume(folder)
    with pytest.raises(BenchError, match=r"cannot write .* Read-only file system"):
        run(["hard-no-motion"], ["SORprox"], results=small_disk, run_id="other")
    assert run_command(["report", str(folder)]) == 0
    printed = capsys.readouterr()
    assert [name for name in load(folder).cases["problem"].unique() if f"{name} · " not in printed.out] == []
    assert re.fullmatch(r"proxbench: cannot write .*/tables/.* Read-only file system; .*\n", printed.err)
    subprocess.run(["mount", "-o", "remount,rw,size=4m", str(small_disk)], check=True)
    assert finished(sandbox, folder) == verdicts(undisturbed)


SPOILED = {
    "vanishes": "shutil.rmtree({folder!r}, ignore_errors=True)",
    "is emptied": "[os.truncate(file, 0) for file in glob.glob({folder!r} + '/**/*.json', recursive=True)]",
    "is written over": "[open(file, 'w').write('[]') for file in glob.glob({folder!r} + '/**/*.json', recursive=True)]",
    "gets pipes": "[(os.unlink(file), os.mkfifo(file)) for file in glob.glob({folder!r} + '/*/*.json')]",
}
"""What another program, a plugin perhaps, does to the folder of a run again and again."""


@pytest.mark.parametrize("how", SPOILED)
def test_a_folder_that_is_spoiled_meanwhile_is_whole_at_the_end(how: str, sandbox: Sandbox, undisturbed: Path) -> None:
    folder = sandbox.results / "it"
    spoiling = SPOILED[how].format(folder=str(folder))
    spoil = f"import glob, os, shutil\ndef spoil(event):\n    {spoiling}\n"
    done = sandbox.run(f"{spoil}run({SMALL}, results={str(sandbox.results)!r}, run_id='it', on_event=spoil)")
    assert done.returncode == 0, done.stderr
    assert verdicts(folder) == verdicts(undisturbed)
    assert load(folder).is_finished
    assert sandbox.left_behind() == []


def test_a_folder_that_cannot_be_made_again_ends_the_run_with_an_error(sandbox: Sandbox) -> None:
    folder = sandbox.results / "it"
    spoil = (
        "import pathlib, shutil\n"
        f"def spoil(event):\n    shutil.rmtree({str(folder)!r}, True); pathlib.Path({str(folder)!r}).touch()\n"
    )
    done = sandbox.run(f"{spoil}run({SMALL}, results={str(sandbox.results)!r}, run_id='it', on_event=spoil)")
    assert "BenchError: cannot write" in done.stderr.strip().splitlines()[-1]
    assert not [left for left in sandbox.left_behind() if left != str(folder)]


def test_two_runs_on_one_folder_do_not_mix(sandbox: Sandbox, undisturbed: Path) -> None:
    first = sandbox.start(f"run({SMALL}, results={str(sandbox.results)!r}, run_id='it')")
    folder = sandbox.results / "it"
    while first.poll() is None and not (folder / "run.json").exists():
        time.sleep(0.01)
    os.kill(first.pid, signal.SIGSTOP)  # however slow the second one is
    with pytest.raises(BenchError, match="another process is writing"):
        resume(folder)
    with pytest.raises(BenchError, match="exists already"):
        run(["hard-no-motion"], ["SORprox"], results=sandbox.results, run_id="it")
    os.kill(first.pid, signal.SIGCONT)
    _, errors = first.communicate(timeout=600)
    assert first.returncode == 0, errors
    assert verdicts(folder) == verdicts(undisturbed)
    assert sandbox.left_behind() == []


class JumpingClock(datetime):
    """A calendar that is set forth and back by years whenever it is read."""

    _chance = Random(3)

    @classmethod
    def now(cls, tz: Any = None) -> "JumpingClock":
        moved = datetime.now(tz) + timedelta(days=cls._chance.uniform(-4000, 4000))
        return cls.fromtimestamp(moved.timestamp(), tz)


def test_a_clock_that_jumps_changes_no_result(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.bench.measure.execution.local.datetime", JumpingClock)
    monkeypatch.setattr(time, "time", lambda: JumpingClock.now(UTC).timestamp())
    problems, solvers = ["hard-sticking-box", "hard-tresca-joint", "funnel-30"], ["SORprox", "ClarabelSOCP"]
    folder = run(problems, solvers, results=tmp_path, run_id="it", tolerances=[1e-1, 1e-3]).folder
    monkeypatch.undo()
    assert verdicts(folder) == verdicts(undisturbed)
    assert load(folder).cases["wall_seconds"].between(0.0, 3600.0).all()


def test_a_run_of_another_version_is_refused_by_name(undisturbed: Path, tmp_path: Path, capsys: Any) -> None:
    folder = Path(shutil.copytree(undisturbed, tmp_path / "it"))
    file = folder / "run.json"
    for text in (file.read_text().replace('"format": 3', '"format": 4'), json.dumps({"runs": []})):
        file.write_text(text)
        for act in (resume, load):
            with pytest.raises(BenchError, match=r"run\.json (is damaged|has format)"):
                act(folder)
        assert run_command(["run", "--resume", str(folder)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("seed", range(20))
def test_damaged_files_are_named_and_cost_only_themselves(undisturbed: Path, tmp_path: Path, seed: int) -> None:
    folder, chance = Path(shutil.copytree(undisturbed, tmp_path / "it")), Random(seed)
    files = sorted((folder / "cases").iterdir())
    hit = chance.sample(files, 3)
    for file in hit:
        content = bytearray(file.read_bytes())
        if chance.random() < 0.3:
            del content[chance.randrange(len(content)) :]
        else:
            content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        file.write_bytes(content)
    frames = load(folder)
    assert sorted(sentence.partition(" ")[0] for sentence in frames.damaged) == sorted(file.name for file in hit)
    assert len(frames.cases) == 3
