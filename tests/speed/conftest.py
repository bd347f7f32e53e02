"""Shared by all speeds: one thread, and what is kept of a run in its file."""

import os
import time
from collections.abc import Iterator
from functools import cache
from typing import Any

import msgspec
import psutil
import pytest
from proxbench.bench.isolation.fork_server import ONE_THREAD
from proxbench.bench.measure.machine import this_machine
from threadpoolctl import threadpool_limits

os.environ.update(ONE_THREAD)


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Hold libraries that were loaded before the environment was set to one thread too."""
    with threadpool_limits(1):
        machine()
        yield


@pytest.fixture(autouse=True)
def load_of_others(request: pytest.FixtureRequest) -> Iterator[None]:
    """Note how many cores other programs kept busy meanwhile: a calibration misses a burst between two of it."""
    benchmark = request.getfixturevalue("benchmark") if "benchmark" in request.fixturenames else None
    began, before = time.perf_counter(), _busy_seconds_of_others()
    yield
    if benchmark is not None:
        busy = (_busy_seconds_of_others() - before) / (time.perf_counter() - began)
        benchmark.extra_info["load_of_others"] = round(max(busy, 0.0), 2)


def _busy_seconds_of_others() -> float:
    """Processor time of the whole machine that is not this program's [s]; living children count as others."""
    whole, own = psutil.cpu_times(), os.times()
    return whole.user + whole.system - (own.user + own.system + own.children_user + own.children_system)


@cache
def machine() -> dict[str, Any]:
    """Describe the machine once, at the start of the run."""
    return msgspec.to_builtins(this_machine())  # type: ignore[no-any-return]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the calibrations over the run, so that drift of the machine shows in them."""
    places = {f"test_calibration[{moment}]": part for moment, part in (("start", 0.0), ("middle", 0.5), ("end", 1.0))}
    others = [item for item in items if item.name not in places]
    held = sorted((item for item in items if item.name in places), key=lambda item: -places[item.name])
    for item in held:  # the last place first, which leaves the others where they are
        others.insert(round(places[item.name] * len(others)), item)
    items[:] = others


def pytest_benchmark_generate_machine_info() -> dict[str, Any]:
    """Describe the machine as runs of the benchmark do, without its name."""
    return machine()


def pytest_benchmark_update_json(output_json: dict[str, Any]) -> None:
    """Drop the single times, which would be most of the file, and how the checkout is called here."""
    for key in ("project", "branch"):
        output_json["commit_info"].pop(key, None)
    for benchmark in output_json["benchmarks"]:
        benchmark["stats"].pop("data", None)
