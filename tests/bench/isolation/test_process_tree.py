"""The descendants of a process are found, timed, stopped and killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from proxbench.bench.isolation.process_tree import (
    descendants,
    describe_exit,
    processor_seconds,
    running,
    send_signal,
    writers,
)

PARENT = "import subprocess, sys; subprocess.Popen(['sleep', '60']); print(flush=True); sys.stdin.read()"


@pytest.fixture
def family() -> Iterator[psutil.Process]:
    """A process with one child."""
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert parent.stdout is not None
    parent.stdout.readline()
    found = psutil.Process(parent.pid)
    members = [found, *found.children()]
    yield found
    for member in members:
        member.kill()
    parent.communicate()


def work(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_processor_time_has_a_finer_resolution_than_system_ticks() -> None:
    """This holds for its own clock; the time of its terminated children is counted in ticks."""
    for _ in range(20):
        work(1.3e-3)
        times = os.times()
        children = times.children_user + times.children_system
        before = time.process_time()
        found = processor_seconds(os.getpid()) - children
        assert before - 1e-9 <= found <= time.process_time() + 1e-9


def test_without_its_clock_the_processor_time_of_a_process_is_that_in_user_and_system_mode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(clock: int) -> float:
        raise OSError(clock)

    work(0.02)
    for _ in range(3000):
        os.stat("/")  # system mode
    monkeypatch.setattr(time, "clock_gettime", refuse)
    before, found, after = os.times(), processor_seconds(os.getpid()), os.times()
    assert sum(before[:4]) - 0.02 <= found <= sum(after[:4]) + 0.02
    assert found >= before.user + before.children_user + before.children_system - 0.02


def test_processes_that_write_to_a_file_are_found(tmp_path: Path) -> None:
    """By standard output or standard error, and not those that write to another file."""
    with (tmp_path / "own").open("w") as own, (tmp_path / "other").open("w") as other:
        started = [
            subprocess.Popen(["sleep", "60"], stdout=output, stderr=errors)
            for output, errors in ((own, other), (other, own), (other, other))
        ]
        try:
            assert sorted(writers(own.fileno())) == sorted(one.pid for one in started[:2])
        finally:
            for one in started:
                one.kill()
                one.wait()


def test_processor_time_of_a_terminated_process_is_zero() -> None:
    ended = subprocess.Popen(["true"])
    ended.wait()
    assert processor_seconds(ended.pid) == 0.0


def test_descendants_are_listed_with_parents_before_children(family: psutil.Process) -> None:
    (child,) = family.children()
    assert descendants(family.pid) == [child.pid]
    own = descendants(os.getpid())
    assert own.index(family.pid) < own.index(child.pid)
    assert descendants(child.pid) == []


def test_a_process_that_has_ended_does_not_run_though_nobody_waited_for_it(family: psutil.Process) -> None:
    ended = subprocess.Popen(["true"])
    while psutil.Process(ended.pid).status() != psutil.STATUS_ZOMBIE:
        time.sleep(1e-3)
    assert running([ended.pid, family.pid]) == [family.pid]
    ended.wait()
    assert running([ended.pid, family.pid]) == [family.pid]


def test_signal_is_sent_to_running_processes(family: psutil.Process) -> None:
    ended = subprocess.Popen(["true"])
    ended.wait()
    send_signal(signal.SIGKILL, [ended.pid, family.pid])
    while family.status() != psutil.STATUS_ZOMBIE:
        time.sleep(1e-3)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("exit 7", "its process ended with exit code 7"),
        ("kill -KILL $$", "its process was killed by SIGKILL"),
        ("kill -40 $$", "its process was killed by signal 40"),
    ],
)
def test_exit_description_follows_from_the_wait_status(code: str, words: str) -> None:
    process = os.spawnlp(os.P_NOWAIT, "sh", "sh", "-c", code)
    _, status = os.waitpid(process, 0)
    assert describe_exit(status) == words
