"""The reference is complete."""

from importlib import import_module
from pathlib import Path

import pytest
from proxbench.solvers.registry import available, factory

REFERENCE = "\n".join(
    page.read_text(encoding="utf-8")
    for page in (Path(__file__).resolve().parents[2] / "docs" / "reference").glob("*.md")
)


def is_listed(name: str) -> bool:
    return any(line.endswith(f":: {name}") for line in REFERENCE.splitlines())


@pytest.mark.parametrize("package", ["proxbench.problems", "proxbench.solvers", "proxbench.bench"])
def test_every_public_name_is_in_the_reference(package: str) -> None:
    documented_elsewhere = {"proxbench.solvers.Model"}  # documented with the problems, where it is defined
    names = {f"{package}.{name}" for name in import_module(package).__all__} - documented_elsewhere
    assert {name for name in names if not is_listed(name)} == set()


def test_every_built_in_solver_is_in_the_reference() -> None:
    classes = {f"{factory(name).__module__}.{name}" for name in available()}
    assert {name for name in classes if not is_listed(name)} == set()
