"""Files that the package reads cannot run code."""

import ast
import json
from pathlib import Path

import proxbench.bench
import pytest

PACKAGES = Path(proxbench.bench.__file__).parents[1]


@pytest.mark.slow
def test_pickle_and_exec_are_used_only_in_the_listed_modules() -> None:
    """A run reads only JSON, arrays and Python literals; it sends pickles to its cases, but accepts none from them."""
    pickling = {
        "pickle": {"worker.py", "fork_server.py", "child.py", "solver_checks.py"},
        "cloudpickle": {"solver_specs.py", "descriptions.py"},
    }
    for package in ("bench", "problems", "solvers"):
        for file in (PACKAGES / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Import):
                    for name in {name.name for name in node.names} & {*pickling, "shelve", "marshal"}:
                        assert file.name in pickling[name]
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("eval", "exec"):
                    assert file.relative_to(PACKAGES).as_posix() == "problems/exchange/plugins/files.py"
                if isinstance(node, ast.keyword) and node.arg == "allow_pickle":
                    assert json.loads(ast.unparse(node.value).lower()) is False
