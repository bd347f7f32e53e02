"""After faults of disk, folder or clock, finished results are kept, and the run can be resumed."""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any

import pytest
from proxbench.bench import load, resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from sandbox import Sandbox, verdicts

SMALL = "['hard-sticking-box', 'funnel-30'], ['SORprox', 'ClarabelSOCP'], tolerances=[1e-1, 1e-3], passes=1"


def run_here(results: Path) -> Path:
    """Execute the small run in this process, which starts its fork server once for all tests."""
    problems, solvers = ["hard-sticking-box", "funnel-30"], ["SORprox", "ClarabelSOCP"]
    return run(problems, solvers, results=results, run_id="it", tolerances=[1e-1, 1e-3], passes=1).folder


@pytest.fixture
def sandbox(tmp_path: Path) -> Sandbox:
    return Sandbox(tmp_path)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_here(tmp_path_factory.mktemp("undisturbed"))


@pytest.mark.weekly
def test_exceeding_the_file_size_limit_stops_the_run_and_keeps_finished_cases(
    sandbox: Sandbox, undisturbed: Path
) -> None:
    sizes = sorted(file.stat().st_size for file in undisturbed.rglob("*.json"))
    folder = sandbox.results / "it"

    def allow_little() -> None:
        _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (sizes[-1] // 2, most))

    done = sandbox.run(f"run({SMALL})", allow_little)
    assert done.returncode == 1
    error = done.stderr.strip().splitlines()[-1]
    assert error.startswith("proxbench.bench.errors.BenchError: cannot write")
    assert "File too large" in error
    assert sandbox.left_behind() == []
    assert 1 <= len(list((folder / "cases").iterdir())) < 4
    assert verdicts(resume(folder).folder) == verdicts(undisturbed)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 kB; the test is skipped without the right to mount one."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("no right to mount a file system")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_or_read_only_disk_is_reported_and_the_run_can_be_resumed(
    undisturbed: Path, small_disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_disk / "it"
    with pytest.raises(BenchError, match=r"cannot write .* No space left"):
        run_here(small_disk)
    assert not list(folder.rglob("*.part"))
    assert load(folder).damaged == []
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    with pytest.raises(BenchError, match=r"cannot write .* Read-only file system"):
        resume(folder)
    with pytest.raises(BenchError, match=r"cannot write .* Read-only file system"):
        run(["hard-no-motion"], ["SORprox"], results=small_disk, run_id="other")
    assert run_command(["report", str(folder)]) == 1  # cases are missing
    printed = capsys.readouterr()
    assert [name for name in load(folder).cases["problem"].unique() if f"{name} · " not in printed.out] == []
    assert re.fullmatch(r"proxbench: cannot write .*/tables/.* Read-only file system; .*\n", printed.err)
    subprocess.run(["mount", "-o", "remount,rw,size=4m", str(small_disk)], check=True)
    assert verdicts(resume(folder).folder) == verdicts(undisturbed)


SPOILED = {
    "removed": "shutil.rmtree(folder, ignore_errors=True)",
    "emptied": "[os.truncate(file, 0) for file in glob.glob(folder + '/**/*.json', recursive=True)]",
    "overwritten": "[open(file, 'w').write('[]') for file in glob.glob(folder + '/**/*.json', recursive=True)]",
    "pipes": "[(os.unlink(file), os.mkfifo(file)) for file in glob.glob(folder + '/*/*.json')]",
}
"""Changes that another program, such as a plugin, makes repeatedly to the folder of a run."""


SPOILED_RUNS = f"""
import glob, os, pathlib, shutil

for how, spoiling in {SPOILED!r}.items():
    folder = results + "/" + how
    run({SMALL}, run_id=how, on_event=lambda event: exec(spoiling))

folder = results + "/it"
run({SMALL}, on_event=lambda event: (shutil.rmtree(folder, True), pathlib.Path(folder).touch()))
"""
"""Runs whose folders are damaged at each event; the folder of the last one cannot be created again."""


@dataclass
class SpoiledRuns:
    """The folder of the damaged runs, the last line of standard error, and what they left behind."""

    results: Path
    error: str
    left_behind: list[str]


@pytest.fixture(scope="module")
def spoiled(tmp_path_factory: pytest.TempPathFactory) -> SpoiledRuns:
    sandbox = Sandbox(tmp_path_factory.mktemp("spoiled"))
    done = sandbox.run(SPOILED_RUNS)
    left_behind = sandbox.left_behind(lambda file: file == sandbox.results / "it")
    return SpoiledRuns(sandbox.results, done.stderr.strip().splitlines()[-1], left_behind)


@pytest.mark.weekly
@pytest.mark.parametrize("how", SPOILED)
def test_a_run_completes_although_its_folder_is_damaged_meanwhile(
    how: str, spoiled: SpoiledRuns, undisturbed: Path
) -> None:
    folder = spoiled.results / how
    assert verdicts(folder) == verdicts(undisturbed), spoiled.error
    assert load(folder).is_finished


@pytest.mark.weekly
def test_a_folder_that_cannot_be_made_again_ends_the_run_with_an_error(spoiled: SpoiledRuns) -> None:
    assert "BenchError: cannot write" in spoiled.error
    assert (spoiled.results / "it").is_file()


@pytest.mark.weekly
def test_runs_on_faulty_storage_leave_no_process_and_no_temporary_file(spoiled: SpoiledRuns) -> None:
    assert spoiled.left_behind == []


@pytest.mark.weekly
def test_two_runs_on_one_folder_do_not_mix(sandbox: Sandbox, undisturbed: Path) -> None:
    first = sandbox.start(f"run({SMALL})")
    folder = sandbox.results / "it"
    while first.poll() is None and not (folder / "run.json").exists():
        time.sleep(0.01)
    os.kill(first.pid, signal.SIGSTOP)  # the first run must still be active when the second one starts
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
    """A calendar that jumps forwards or backwards by years whenever it is read."""

    _chance = Random(3)

    @classmethod
    def now(cls, tz: Any = None) -> "JumpingClock":
        moved = datetime.now(tz) + timedelta(days=cls._chance.uniform(-4000, 4000))
        return cls.fromtimestamp(moved.timestamp(), tz)


def test_jumps_of_the_system_clock_do_not_change_results(
    tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.bench.measure.execution.local.datetime", JumpingClock)
    monkeypatch.setattr(time, "time", lambda: JumpingClock.now(UTC).timestamp())
    folder = run_here(tmp_path)
    monkeypatch.undo()
    assert verdicts(folder) == verdicts(undisturbed)
    assert load(folder).cases["wall_seconds"].between(0.0, 3600.0).all()


def test_a_run_of_another_format_is_refused_with_its_file_name(undisturbed: Path, tmp_path: Path, capsys: Any) -> None:
    folder = Path(shutil.copytree(undisturbed, tmp_path / "it"))
    file = folder / "run.json"
    for text in (file.read_text().replace('"format": 3', '"format": 4'), json.dumps({"runs": []})):
        file.write_text(text)
        for act in (resume, load):
            with pytest.raises(BenchError, match=r"run\.json (is damaged|has format)"):
                act(folder)
        assert run_command(["run", "--resume", str(folder)]) == 2
        assert capsys.readouterr().err.count("\n") == 1
