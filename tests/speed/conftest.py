"""Shared by all speed tests: one thread."""

import os
from collections.abc import Iterator

import pytest
from proxbench.bench.isolation.fork_server import ONE_THREAD
from threadpoolctl import threadpool_limits

os.environ.update(ONE_THREAD)


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Restrict libraries that were loaded before the environment was set to one thread."""
    with threadpool_limits(1):
        yield
