"""Changes to the state of a shared process are detected."""

import json
import os
import sys
import types
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from proxbench.bench.isolation import pipe, process_tree
from proxbench.bench.isolation.child import Assignment
from proxbench.bench.isolation.process_state import ProcessState, replacement_text


def test_idle_process_has_no_changed_state() -> None:
    before = ProcessState.now()
    assert (before.replaced_names(), before.changed_settings(), before.changed_timing_settings()) == ([], [], [])
    assert replacement_text(before) == ""


@pytest.mark.parametrize(
    ("owner", "name", "value", "found"),
    [
        (pipe, "extra", 1, "isolation.pipe.extra"),
        (Assignment, "extra", 1, "isolation.child.Assignment.extra"),
        (process_tree, "send_signal", len, "isolation.process_tree.send_signal"),
        (
            process_tree.send_signal,
            "__code__",
            process_tree.describe_exit.__code__,
            "isolation.process_tree.send_signal.__code__",
        ),
        (json, "dumps", str, "json.dumps"),
        (np, "dot", np.add, "numpy.dot"),
        (np.linalg, "norm", np.add, "numpy.linalg.norm"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_name_that_is_replaced_in_the_framework_or_added_to_it_is_found(
    monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, value: object, found: str
) -> None:
    before = ProcessState.now()
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, value, raising=False)
        changed, sentence = before.replaced_names(), replacement_text(before)
    assert changed[0].endswith(found)
    assert sentence.startswith(f"it replaced {changed[0]}")
    assert before.replaced_names() == []


def test_a_name_that_is_removed_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    before = ProcessState.now()
    monkeypatch.delattr(pipe, "is_readable")
    assert before.replaced_names()[0].endswith("pipe.is_readable")


def test_message_names_the_first_of_several_replaced_names(monkeypatch: pytest.MonkeyPatch) -> None:
    before = ProcessState.now()
    monkeypatch.setattr(pipe, "is_readable", len)
    monkeypatch.setattr(pipe, "read_message", len)
    assert " and more; do not modify" in replacement_text(before)


@pytest.fixture
def new_module() -> Iterator[str]:
    name = "proxbench.problems.loaded_later"
    yield name
    sys.modules.pop(name, None)


def test_newly_loaded_modules_do_not_count_as_changes(new_module: str) -> None:
    before = ProcessState.now()
    module = types.ModuleType(new_module)
    module.answer = 42  # type: ignore[attr-defined]
    sys.modules[new_module] = module
    assert before.replaced_names() == []


def test_changes_of_process_state_by_imports_are_accepted(new_module: str) -> None:
    before, errors = ProcessState.now(), np.geterr()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ImportWarning)
            assert before.after_imports().changed_settings() == ["the warning filters"]
            sys.modules[new_module] = types.ModuleType(new_module)
            assert before.after_imports().changed_settings() == []
            np.seterr(over="ignore")
            assert before.after_imports().changed_settings() == ["numpy's error state"]
    finally:
        np.seterr(**errors)


@pytest.mark.parametrize(
    ("what", "change", "restore"),
    [
        ("the working folder", lambda: os.chdir("/"), lambda folder: os.chdir(folder)),
        ("the environment", lambda: os.environ.update(EXTRA="1"), lambda _: os.environ.pop("EXTRA")),
        ("the import path", lambda: sys.path.append("/extra"), lambda _: sys.path.remove("/extra")),
        ("the recursion limit", lambda: sys.setrecursionlimit(2345), lambda _: sys.setrecursionlimit(1000)),
        ("numpy's global random state", lambda: np.random.seed(1), lambda _: None),  # noqa: NPY002
    ],
)
def test_changed_process_settings_are_reported(
    what: str, change: Callable[[], Any], restore: Callable[[str], Any]
) -> None:
    folder = os.getcwd()
    sys.setrecursionlimit(1000)
    before = ProcessState.now()
    change()
    changed, timing = before.changed_settings(), before.changed_timing_settings()
    restore(folder)
    assert changed == [what]
    assert timing == ([what] if what == "the recursion limit" else [])
