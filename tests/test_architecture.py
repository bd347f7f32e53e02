"""Arrows go one way: problems ← solvers ← bench, without circles, and heavy libraries stay in their rooms."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FILES = [file for top in ("problems", "solvers", "bench") for file in sorted((ROOT / top).rglob("*.py"))]
BELOW = {"problems": {"problems"}, "solvers": {"problems", "solvers"}, "bench": {"problems", "solvers", "bench"}}
RECORDED_WITH_RERUN = (
    "annotations",
    "balls",
    "blueprints",
    "bodies",
    "file",
    "simulation",
    "solves",
    "still",
    "woodpecker",
)
AT_HOME = {
    "altair": {
        "bench/report/drawing.py",
        "bench/report/charts.py",
        "bench/report/summary_charts.py",
        "bench/simulation/chart.py",
        "bench/study/chart.py",
        "bench/variable/figure.py",
    },
    "vl_convert": {"bench/report/drawing.py"},
    "clarabel": {"solvers/conic/programs.py"},
    "pandas": {
        "bench/report/drawing.py",
        "bench/store/frames.py",
        "bench/report/tables.py",
        "bench/report/charts.py",
        "bench/report/summary_charts.py",
        "bench/simulation/chart.py",
        "bench/study/chart.py",
        "bench/variable/figure.py",
    },
    "typer": {"bench/cli/main.py", "bench/cli/options.py", "bench/cli/matrix.py", "bench/cli/simulate.py"},
    "rerun": {f"bench/recordings/{name}.py" for name in RECORDED_WITH_RERUN},
    "psutil": {"bench/measure/machine.py", "bench/isolation/child.py", "bench/isolation/process_tree.py"},
}


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


def imports(file: Path) -> Iterator[tuple[int, str, list[str]]]:
    """Level, module and names of every import of a file, wherever it stands."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((0, alias.name, []) for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            yield node.level, node.module or "", [alias.name for alias in node.names]


def targets(file: Path) -> set[Path]:
    """Files of the project that a file imports."""
    found = set()
    for level, module, names in imports(file):
        if not level:
            continue
        base = file.parent
        for _ in range(level - 1):
            base = base.parent
        place = base.joinpath(*module.split(".")) if module else base
        for candidate in (place.with_suffix(".py"), *(place / f"{name}.py" for name in names)):
            if candidate.is_file():
                found.add(candidate)
    return found


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_imports_inside_the_packages_are_relative_and_go_down(file: Path) -> None:
    top = file.relative_to(ROOT).parts[0]
    for level, module, _ in imports(file):
        if not level:
            assert module.split(".")[0] not in ("problems", "solvers", "bench", "proxbench")
    for target in targets(file):
        assert target.relative_to(ROOT).parts[0] in BELOW[top]


def test_no_files_import_each_other_in_a_circle() -> None:
    arrows = {file: targets(file) - {file} for file in FILES}
    # the type-only arrow of the judge to the problem it judges is no arrow when the program runs
    arrows[ROOT / "problems/contact/judge.py"] -= {ROOT / "problems/contact/problem.py"}
    open_files = dict(arrows)
    while True:
        leaves = {file for file, below in open_files.items() if not below & set(open_files)}
        if not leaves:
            break
        open_files = {file: below for file, below in open_files.items() if file not in leaves}
    assert not [name_of(file) for file in open_files]


@pytest.mark.parametrize("library", AT_HOME)
def test_a_heavy_library_is_imported_only_where_it_is_the_business(library: str) -> None:
    users = {name_of(file) for file in FILES if any(module.split(".")[0] == library for _, module, _ in imports(file))}
    assert users <= AT_HOME[library]


@pytest.mark.parametrize("file", FILES, ids=name_of)
def test_files_are_short_and_have_a_subject(file: Path) -> None:
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 400
    assert file.stem != "utils"
    assert ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
