"""Arrows go one way: problems ← solvers ← bench, without circles, and heavy libraries stay in their rooms."""

import ast
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from functools import cache
from pathlib import Path
from typing import TypeVar

import pytest

Node = TypeVar("Node")

ROOT = Path(__file__).parent.parent
FACE = ROOT / "bench" / "package"
"""The package proxbench itself, a room of bench that is installed above the three."""

FILES = [file for top in ("problems", "solvers", "bench") for file in sorted((ROOT / top).rglob("*.py"))]
BELOW = {"problems": {"problems"}, "solvers": {"problems", "solvers"}, "bench": {"problems", "solvers", "bench"}}
RECORDED_WITH_RERUN = (
    "bodies/balls",
    "bodies/contact_patches",
    "bodies/joints",
    "bodies/rigid_bodies",
    "bodies/woodpecker",
    "blueprints",
    "contact_states",
    "file",
    "headless",
    "simulation",
    "solves",
)
MOST_ROOMS = 12
LONGEST_FILE = 400

MOST_ARROWS = 40
"""Between the folders of bench."""

AT_HOME = {
    "altair": {
        "bench/report/charts/drawing.py",
        "bench/report/charts/plots.py",
        "bench/report/charts/problems.py",
        "bench/report/charts/profiles.py",
        "bench/report/charts/summary.py",
        "bench/report/charts/templates.py",
        "bench/simulation/view/chart.py",
    },
    "vl_convert": {"bench/report/charts/drawing.py"},
    "clarabel": {"solvers/conic/programs.py", "problems/motion/equilibrium.py"},
    "pandas": {
        "bench/report/charts/drawing.py",
        "bench/store/frames.py",
        "bench/store/ratios.py",
        "bench/runs.py",
        "bench/report/endings.py",
        "bench/report/studies.py",
        "bench/report/accuracy.py",
        "bench/report/tables.py",
        "bench/report/cells.py",
        "bench/report/layout/terminal_table.py",
        "bench/report/build_report.py",
        "bench/report/matrix.py",
        "bench/report/page/document.py",
        "bench/report/profiles.py",
        "bench/report/charts/problems.py",
        "bench/report/charts/profiles.py",
        "bench/report/charts/summary.py",
        "bench/report/comparison/comparison.py",
        "bench/report/comparison/page.py",
        "bench/report/comparison/pairing.py",
        "bench/report/comparison/solved_changes.py",
        "bench/report/comparison/times.py",
        "bench/simulation/view/chart.py",
    },
    "typer": {
        f"bench/cli/{name}.py"
        for name in (
            "comparison/check",
            "comparison/compare",
            "catalog",
            "exchange/problem_files",
            "main",
            "options",
            "record",
            "report",
            "run",
            "simulation/command",
            "simulation/engines",
            "simulation/statics",
            "exchange/bundles",
            "exchange/capture",
        )
    },
    "h5py": {f"problems/exchange/fclib/{name}.py" for name in ("container", "files")},
    "rerun": {f"bench/recordings/{name}.py" for name in RECORDED_WITH_RERUN},
    "warp": {f"solvers/prox/parallel/warp_{name}.py" for name in ("kernels", "sweeps")},
    "distributed": {"bench/measure/execution/cluster.py"},
    "psutil": {"bench/measure/machine.py"}
    | {f"bench/isolation/{name}.py" for name in ("child", "process_tree", "process_usage")},
}


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def imports(file: Path) -> list[tuple[int, str, list[str]]]:
    """Level, module and names of every import of a file, wherever it stands."""
    found: list[tuple[int, str, list[str]]] = []
    for node in ast.walk(parsed(file)):
        if isinstance(node, ast.Import):
            found += [(0, alias.name, []) for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            found.append((node.level, node.module or "", [alias.name for alias in node.names]))
    return found


@cache
def targets(file: Path) -> frozenset[Path]:
    """Files of the project that a file imports."""
    found = set()
    for level, module, names in imports(file):
        if not level:
            continue
        base = ROOT if file.parent == FACE else file.parent
        for _ in range(level - 1):
            base = base.parent
        place = base.joinpath(*module.split(".")) if module else base
        for candidate in (place.with_suffix(".py"), *(place / f"{name}.py" for name in names)):
            if candidate.is_file():
                found.add(candidate)
    return frozenset(found)


def in_circles(arrows: Mapping[Node, AbstractSet[Node]]) -> set[Node]:
    """What is left when all that imports nothing else that is left is taken away, again and again."""
    left = dict(arrows)
    while True:
        leaves = {node for node, below in left.items() if not below & set(left)}
        if not leaves:
            return set(left)
        left = {node: below for node, below in left.items() if node not in leaves}


def room_of(file: Path) -> str:
    """The folder of its floor that a file is in, or the file itself if it is in none."""
    return "/".join(file.relative_to(ROOT).parts[:2])


def folder_arrows(floor: str) -> set[tuple[str, str]]:
    """Which folder of a floor imports which other; the floor's own ``__init__`` gathers names and is left out."""
    pairs = {(file, target) for file in FILES if file != ROOT / floor / "__init__.py" for target in targets(file)}
    arrows = {(room_of(file), room_of(target)) for file, target in pairs}
    return {(a, b) for a, b in arrows if a != b and a.startswith(f"{floor}/") and b.startswith(f"{floor}/")}


def test_imports_inside_the_packages_are_relative_and_go_down() -> None:
    absolute = {
        (name_of(file), module)
        for file in FILES
        for level, module, _ in imports(file)
        if not level and module.split(".")[0] in ("problems", "solvers", "bench", "proxbench")
    }
    assert absolute == set()
    up = {
        (name_of(file), name_of(target))
        for file in FILES
        for target in targets(file)
        if target.relative_to(ROOT).parts[0] not in BELOW[file.relative_to(ROOT).parts[0]]
    }
    assert up == set()


def test_no_files_import_each_other_in_a_circle() -> None:
    arrows = {file: targets(file) - {file} for file in FILES}
    # the type-only arrow of the judge to the problem it judges is no arrow when the program runs
    arrows[ROOT / "problems/contact/judge.py"] -= {ROOT / "problems/contact/problem.py"}
    assert not [name_of(file) for file in in_circles(arrows)]


@pytest.mark.parametrize("floor", BELOW)
def test_no_folders_of_a_floor_import_each_other_in_a_circle(floor: str) -> None:
    below: dict[str, set[str]] = {room_of(file): set() for file in FILES if name_of(file).startswith(floor)}
    for source, target in folder_arrows(floor):
        below[source].add(target)
    assert not in_circles(below)


def test_the_folders_of_bench_have_few_arrows() -> None:
    between = {pair for pair in folder_arrows("bench") if not any(name.endswith(".py") for name in pair)}
    assert len(between) <= MOST_ARROWS, sorted(between)


def test_a_folder_has_few_rooms_and_says_who_lives_there() -> None:
    folders = {file.parent for file in FILES}
    assert {name_of(folder): count for folder in folders if (count := rooms(folder)) > MOST_ROOMS} == {}
    assert [name_of(folder) for folder in folders if not ast.get_docstring(parsed(folder / "__init__.py"))] == []


def rooms(folder: Path) -> int:
    files = {file for file in folder.glob("*.py") if file.name != "__init__.py"}
    return len(files) + sum((path / "__init__.py").is_file() for path in folder.iterdir())


@pytest.mark.parametrize("library", AT_HOME)
def test_a_heavy_library_is_imported_only_where_it_is_the_business(library: str) -> None:
    users = {name_of(file) for file in FILES if any(module.split(".")[0] == library for _, module, _ in imports(file))}
    assert users <= AT_HOME[library]


def test_files_are_short_and_have_a_subject() -> None:
    lengths = {name_of(file): len(file.read_text(encoding="utf-8").splitlines()) for file in FILES}
    assert {name: length for name, length in lengths.items() if length > LONGEST_FILE} == {}
    assert [name_of(file) for file in FILES if file.stem == "utils" or not ast.get_docstring(parsed(file))] == []
