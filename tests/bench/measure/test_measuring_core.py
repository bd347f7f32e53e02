"""A run reserves a core, puts its processes there, and detects when the core becomes slower."""

import os
import subprocess
import sys
import time

import pytest
from proxbench.bench.measure.measuring_core import MAX_PROBE_RATIO, MeasuringCore

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system pins no process")


@pytest.fixture(autouse=True)
def own_claims(monkeypatch: pytest.MonkeyPatch) -> None:
    """Separate the claims from those of other tests that run at the same time."""
    monkeypatch.setattr("proxbench.bench.measure.measuring_core.CLAIM", f"test-{os.getpid()}")
    monkeypatch.setattr("proxbench.bench.measure.measuring_core.MAX_PROBE_RATIO", MAX_PROBE_RATIO)


def test_every_core_is_claimed_once_and_again_when_it_is_released() -> None:
    cores = [MeasuringCore.claim() for _ in os.sched_getaffinity(0)]
    assert sorted(core.number for core in cores if core.number is not None) == sorted(os.sched_getaffinity(0))
    assert MeasuringCore.claim().number is None
    cores[0].release()
    assert MeasuringCore.claim().number == cores[0].number


def test_leaving_the_pinned_core_is_detected() -> None:
    core = MeasuringCore.claim()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        core.pin(process.pid)
        assert os.sched_getaffinity(process.pid) == {core.number}
        assert core.has_pinned(process.pid)
        os.sched_setaffinity(process.pid, os.sched_getaffinity(0))
        assert core.has_pinned(process.pid) is (len(os.sched_getaffinity(0)) == 1)
        process.communicate(b"\n")


def test_a_process_of_several_threads_gets_further_cores() -> None:
    core, allowed = MeasuringCore.claim(), os.sched_getaffinity(0)
    with core.pinned(), subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        core.pin(process.pid, 2)
        given = os.sched_getaffinity(process.pid)
        assert core.number in given
        assert len(given) == min(2, len(allowed))
        assert core.has_pinned(process.pid, 2)
        assert core.has_pinned(process.pid) is (len(allowed) == 1)
        process.communicate(b"\n")


def test_pinning_is_undone_afterwards() -> None:
    core, before = MeasuringCore.claim(), os.sched_getaffinity(0)
    with core.pinned():
        assert os.sched_getaffinity(0) == {core.number}
        assert core.probes
    assert os.sched_getaffinity(0) == before


def test_work_on_the_other_cores_is_counted() -> None:
    core = MeasuringCore.claim()
    others = sorted(os.sched_getaffinity(0) - {core.number})
    if not others:
        pytest.skip("there is one core alone")
    code = (
        f"import os, time; os.sched_setaffinity(0, {{{others[0]}}}); end = time.time() + 30\nwhile time.time() < end: 1"
    )
    with subprocess.Popen([sys.executable, "-c", code]) as process, core.pinned():
        _work(0.5)
        process.kill()
    assert core.busy_cores > 0.5


def test_probe_is_steady_up_to_the_maximum_ratio() -> None:
    core = MeasuringCore(0, probes=[1.0, 1.0, 1.1, 2.0])
    assert core.is_steady(1.0, MAX_PROBE_RATIO)
    assert not core.is_steady(1.0, MAX_PROBE_RATIO + 0.01)
    assert MeasuringCore(None, probes=[1.0]).is_steady(9.0)  # probes run on any core


def _work(seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass
