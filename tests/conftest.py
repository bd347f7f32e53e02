"""How much property tests try: little by default, thousands of examples with PROXBENCH_PROFILE=full."""

import os

import pytest
from hypothesis import settings

settings.register_profile("quick", max_examples=40, deadline=None)
settings.register_profile("full", max_examples=1000, deadline=None)
settings.load_profile("full" if os.environ.get("PROXBENCH_PROFILE") == "full" else "quick")


@pytest.fixture(scope="session")
def is_full() -> bool:
    """Whether everything is tried, whatever it takes."""
    return os.environ.get("PROXBENCH_PROFILE") == "full"
