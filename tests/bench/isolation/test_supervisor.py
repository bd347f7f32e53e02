"""A supervisor reads signals from a pipe, then restores their defaults; it ends early if its run no longer waits."""

import os
import signal
import socket
from pathlib import Path

import pytest
from proxbench.bench.isolation.child import Assignment
from proxbench.bench.isolation.supervisor import _SIGNALS, _restore_signals, _signal_pipe, supervise


def test_signals_are_written_to_the_pipe_until_handlers_are_restored() -> None:
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    try:
        wakeup = _signal_pipe()
        signal.raise_signal(signal.SIGTERM)
        assert os.read(wakeup[0], 16) == bytes([signal.SIGTERM])
        with pytest.raises(BlockingIOError):
            os.read(wakeup[0], 16)
        _restore_signals(wakeup)
        assert {signal.getsignal(number) for number in _SIGNALS} == {signal.SIG_DFL}
        assert signal.set_wakeup_fd(-1) == -1
        for end in wakeup:
            with pytest.raises(OSError, match="Bad file descriptor"):
                os.fstat(end)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_supervisor_exits_without_a_case_if_its_run_is_gone(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    assignment = Assignment(b"", "", [], 2**28, folder, {})
    run, orders = socket.socketpair()
    run.close()
    process = os.fork()
    if process == 0:
        try:
            supervise(0, orders.fileno(), 1, assignment)
        finally:
            os._exit(1)
    assert os.waitpid(process, 0)[1] == 0
    assert not folder.exists()
    orders.close()
