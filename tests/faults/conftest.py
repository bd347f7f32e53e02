"""Runs of these tests ignore the load of the machine, except those of cheats, which are found by their times."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from times_under_load import ignore_load

HERE = Path(__file__).parent


@pytest.fixture(autouse=True, scope="module")
def _without_load(request: pytest.FixtureRequest) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        if request.path.parent == HERE:
            ignore_load(patch)
        yield
