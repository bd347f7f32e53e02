"""Copies and pickles of records have the same numbers, and their arrays are read-only where the originals are."""

import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import (
    Answer,
    ContactProblem,
    InsufficientMemoryError,
    PluginError,
    ProblemError,
    ProxbenchError,
    judge,
    load,
)
from proxbench.problems.contact.matrices.factors import InverseMass
from proxbench.solvers import Solution, Stop, solve

G = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.1], [0.0, 0.1, 3.0]])
C = np.array([-1.0, 0.5, 0.2])


def problems() -> dict[str, ContactProblem]:
    known: dict[str, Any] = {"provenance": {"seed": 1}, "answer": Answer(velocity=C), "keys": ("foot",)}
    return {
        "G": ContactProblem.from_delassus(G, C, 0.3, name="block", **known),
        "factors": ContactProblem.from_factors(np.eye(3), G, C, 0.3),
        "balls": load("funnel-100"),
    }


def solution() -> Solution:
    return solve(problems()["G"], "SORprox")


RECORDS: dict[str, Callable[[], Any]] = {
    "problem with G": lambda: problems()["G"],
    "problem with factors": lambda: problems()["factors"],
    "problem of balls": lambda: problems()["balls"],
    "laws": lambda: problems()["G"].laws,
    "factors": lambda: problems()["factors"].factors,
    "inverse mass": lambda: InverseMass.create(G),
    "layout": lambda: problems()["G"].layout,
    "blocks": lambda: problems()["G"].delassus_blocks(),
    "answer": lambda: problems()["G"].answer,
    "verdict": lambda: judge(problems()["G"], np.zeros(3)),
    "solution": solution,
    "stop": lambda: Stop(1e-3),
}

COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda value: pickle.loads(pickle.dumps(value))}


def arrays_of(value: Any, path: str = "") -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Yield the arrays in the fields of a record, with their paths."""
    if isinstance(value, np.ndarray):
        yield path, value
    elif sp.issparse(value):
        for part in ("data", "indices", "indptr"):
            yield f"{path}.{part}", getattr(value, part)
    elif isinstance(value, tuple):
        for index, part in enumerate(value):
            yield from arrays_of(part, f"{path}[{index}]")
    elif is_dataclass(value):
        for item in fields(value):
            yield from arrays_of(getattr(value, item.name), f"{path}.{item.name}")


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("made", RECORDS.values(), ids=RECORDS)
def test_a_copy_has_equal_arrays_that_are_read_only_where_they_were(
    made: Callable[[], Any], copied: Callable[[Any], Any]
) -> None:
    record = made()
    other = copied(record)
    assert type(other) is type(record)
    assert repr(other) == repr(record)
    original, found = dict(arrays_of(record)), dict(arrays_of(other))
    assert found.keys() == original.keys()
    for path, array in original.items():
        np.testing.assert_array_equal(found[path], array)
        assert found[path].flags.writeable == array.flags.writeable, path


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("name", ["G", "factors", "balls"])
def test_a_copy_of_a_problem_has_its_digest_and_its_solution(name: str, copied: Callable[[Any], Any]) -> None:
    problem = problems()[name]
    other = copied(problem)
    assert other.digest == problem.digest
    assert (other.name, other.provenance, other.keys) == (problem.name, problem.provenance, problem.keys)
    assert isinstance(other.provenance, MappingProxyType)
    limit = {"max_iterations": 5}
    np.testing.assert_array_equal(
        solve(other, "SORprox", **limit).impulses, solve(problem, "SORprox", **limit).impulses
    )


def test_a_pickle_of_a_problem_omits_what_can_be_assembled_again() -> None:
    problem = load("funnel-100")
    size = len(pickle.dumps(problem))
    problem.delassus()
    assert len(pickle.dumps(problem)) == size


class RowError(ProblemError):
    """Composes its message from other arguments."""

    def __init__(self, row: int, *, remedy: str) -> None:
        super().__init__(f"row {row} is empty; {remedy}.")
        self.row = row


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_a_copy_of_any_error_has_its_message(copied: Callable[[Any], Any]) -> None:
    for kind in (ProxbenchError, *ProxbenchError.__subclasses__(), InsufficientMemoryError, PluginError):
        if "__init__" not in vars(kind):
            other = copied(kind("it is full."))
            assert (type(other), str(other), other.args) == (kind, "it is full.", ("it is full.",))


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_a_copy_of_an_error_has_its_message_and_attributes(copied: Callable[[Any], Any]) -> None:
    other = copied(RowError(3, remedy="omit it"))
    assert (type(other), str(other), other.row) == (RowError, "row 3 is empty; omit it.", 3)
