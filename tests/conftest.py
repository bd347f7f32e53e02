"""Extent of the tests: property tests use the same few examples every day; slow and weekly tests are marked.

With PROXBENCH_PROFILE=full or hunt, property tests use more examples. Numerical libraries use one thread, as in
measurements, because tests already share the cores.
"""

import gc
import os

import pytest
from hypothesis import settings

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
os.environ.update(ONE_THREAD)  # before any test file imports numpy
gc.disable()  # until all tests are collected
os.environ["_TYPER_FORCE_DISABLE_TERMINAL"] = "1"  # typer draws help for a terminal if GITHUB_ACTIONS is set

settings.register_profile("quick", max_examples=40, deadline=None, derandomize=True)  # failures are reproducible
settings.register_profile("full", max_examples=500, deadline=None)
settings.register_profile("hunt", max_examples=5000, deadline=None)
settings.load_profile({"full": "full", "hunt": "hunt"}.get(os.environ.get("PROXBENCH_PROFILE", ""), "quick"))


def pytest_sessionstart() -> None:
    """Suppress the notice of compilation, which the first test to compile a kernel would print."""
    from proxbench.problems.compilation.notice import COMPILATION

    COMPILATION.silence()


SLOW_FOLDERS = {"faults"}
"""Folders of tests that are all slow."""

WEEKLY_FOLDERS = {"long"}
"""Folders of tests that are all weekly."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of slow and weekly folders, and weekly tests as slow."""
    for item in items:
        if WEEKLY_FOLDERS.intersection(item.path.parts):
            item.add_marker("weekly")
        if SLOW_FOLDERS.intersection(item.path.parts) or item.get_closest_marker("weekly"):
            item.add_marker("slow")


def pytest_collection_finish() -> None:
    """Exempt the collected tests from garbage collections, each of which would visit all of them."""
    gc.collect()
    gc.freeze()
    gc.enable()
