"""The record of a machine has the version of every library whose solvers, captures or contacts may be measured."""

import re
from importlib import metadata

import pytest
from proxbench.bench.measure import machine

EXTRAS = ("peers", "kamino", "mujoco", "bodies")


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_libraries_of_an_extra_are_among_the_versions(extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    required = [
        text for text in metadata.requires("proxbench") or [] if re.search(rf"extra == ['\"]{extra}['\"]", text)
    ]
    names = {re.match(r"[\w-]+", text).group() for text in required}  # type: ignore[union-attr]
    monkeypatch.setattr(machine.metadata, "version", lambda name: "1.0")
    assert names
    assert names <= set(machine.this_machine().versions)


def test_only_installed_libraries_have_a_version() -> None:
    versions = machine.this_machine().versions
    assert "numpy" in versions
    assert all(versions.values())
