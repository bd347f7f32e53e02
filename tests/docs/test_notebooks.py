"""The notebooks of the documentation run from top to bottom, and contain no outputs."""

import ast
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "notebooks").glob("*.ipynb"))
MAX_OUTPUT_LENGTH = 20_000
"""Characters that a cell may show."""


def cells(notebook: Path, kind: str) -> list[dict[str, Any]]:
    document = json.loads(notebook.read_text(encoding="utf-8"))
    return [cell for cell in document["cells"] if cell["cell_type"] == kind]


def run_cell(source: str, namespace: dict[str, Any]) -> str:
    """Run a cell; return the text that a notebook shows for its last expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), namespace)
    if not isinstance(last, ast.Expr):
        return ""
    value = eval(compile(ast.Expression(last.value), "cell", "eval"), namespace)
    return str(value._repr_html_() if hasattr(value, "_repr_html_") else repr(value))


def test_expected_notebooks_are_found() -> None:
    assert [notebook.stem for notebook in NOTEBOOKS] == ["first-solve", "read-a-run"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "notebook",
    [
        pytest.param(notebook, id=notebook.stem, marks=pytest.mark.weekly if notebook.stem == "read-a-run" else [])
        for notebook in NOTEBOOKS
    ],
)
def test_a_notebook_runs_from_top_to_bottom(
    notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__main__"}
    shown = [run_cell("".join(cell["source"]), namespace) for cell in cells(notebook, "code")]
    assert max(map(len, shown)) <= MAX_OUTPUT_LENGTH
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_a_notebook_holds_no_outputs(notebook: Path) -> None:
    assert [cell["outputs"] for cell in cells(notebook, "code")] == [[]] * len(cells(notebook, "code"))
    assert {cell["execution_count"] for cell in cells(notebook, "code")} == {None}


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_a_notebook_is_linked_from_the_first_page(notebook: Path) -> None:
    page = notebook.parents[1] / "index.md"
    assert f"notebooks/{notebook.name}" in page.read_text(encoding="utf-8")
