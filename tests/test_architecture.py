"""Imports go one way, problems ← solvers ← bench, without cycles, and only some folders import heavy libraries."""

import ast
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from functools import cache
from pathlib import Path
from typing import TypeVar

import pytest

Node = TypeVar("Node")

ROOT = Path(__file__).parent.parent
PACKAGE_ROOT = ROOT / "bench" / "package"
"""The top level of the package ``proxbench``: a folder of ``bench`` that is installed above the three."""

FILES = [file for top in ("problems", "solvers", "bench") for file in sorted((ROOT / top).rglob("*.py"))]
BELOW = {"problems": {"problems"}, "solvers": {"problems", "solvers"}, "bench": {"problems", "solvers", "bench"}}
MAX_ENTRIES = 12
MAX_FILE_LINES = 400
MAX_POSITIONAL = 5

MAX_ARROWS = 40
"""Largest number of imports between folders of bench."""

IMPORTERS = {
    "altair": ["bench/report/charts/", "bench/simulation/view/chart.py"],
    "clarabel": ["solvers/conic/programs.py", "problems/motion/equilibrium.py"],
    "distributed": ["bench/measure/execution/cluster.py"],
    "h5py": ["problems/exchange/fclib/"],
    "pandas": [
        "bench/report/",
        "bench/simulation/view/chart.py",
        "bench/store/frames.py",
        "bench/store/ratios.py",
    ],
    "psutil": ["bench/isolation/", "bench/measure/machine.py"],
    "rerun": ["bench/recordings/"],
    "typer": ["bench/cli/"],
    "vl_convert": ["bench/report/charts/drawing.py", "bench/report/charts/drawing_script.py"],
    "warp": ["solvers/prox/parallel/"],
}
"""The folders and files that may import a heavy library."""


def name_of(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements of a node, also inside functions, without their expressions, which are most of all nodes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt | ast.ExceptHandler | ast.match_case):
            yield child
            yield from statements(child)


@cache
def imports(file: Path) -> list[tuple[int, str, list[str]]]:
    """Return level, module and names of every import of a file, also inside functions."""
    found: list[tuple[int, str, list[str]]] = []
    for node in statements(parsed(file)):
        if isinstance(node, ast.Import):
            found += [(0, alias.name, []) for alias in node.names]
        if isinstance(node, ast.ImportFrom):
            found.append((node.level, node.module or "", [alias.name for alias in node.names]))
    return found


@cache
def targets(file: Path) -> frozenset[Path]:
    """Return the files of the project that a file imports."""
    found = set()
    for level, module, names in imports(file):
        if not level:
            continue
        base = ROOT if file.parent == PACKAGE_ROOT else file.parent
        for _ in range(level - 1):
            base = base.parent
        place = base.joinpath(*module.split(".")) if module else base
        for candidate in (place.with_suffix(".py"), *(place / f"{name}.py" for name in names)):
            if candidate.is_file():
                found.add(candidate)
    return frozenset(found)


def nodes_on_cycles(arrows: Mapping[Node, AbstractSet[Node]]) -> set[Node]:
    """Return the nodes that remain after leaves are removed repeatedly: those on cycles, or above one."""
    left = dict(arrows)
    while True:
        leaves = {node for node, below in left.items() if not below & set(left)}
        if not leaves:
            return set(left)
        left = {node: below for node, below in left.items() if node not in leaves}


def folder_of(file: Path) -> str:
    """Return the second-level folder of a file, or the file itself if it is in none."""
    return "/".join(file.relative_to(ROOT).parts[:2])


def folder_arrows(package: str) -> set[tuple[str, str]]:
    """Return the imports between folders of a package, except for those of its ``__init__``, which collects names."""
    pairs = {(file, target) for file in FILES if file != ROOT / package / "__init__.py" for target in targets(file)}
    arrows = {(folder_of(file), folder_of(target)) for file, target in pairs}
    return {(a, b) for a, b in arrows if a != b and a.startswith(f"{package}/") and b.startswith(f"{package}/")}


def test_imports_inside_the_packages_are_relative_and_from_lower_layers() -> None:
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


def test_imports_of_files_have_no_cycle() -> None:
    arrows = {file: targets(file) - {file} for file in FILES}
    # this import serves type checking only
    arrows[ROOT / "problems/contact/judge.py"] -= {ROOT / "problems/contact/problem.py"}
    assert not [name_of(file) for file in nodes_on_cycles(arrows)]


@pytest.mark.parametrize("package", BELOW)
def test_imports_of_folders_have_no_cycle(package: str) -> None:
    below: dict[str, set[str]] = {folder_of(file): set() for file in FILES if name_of(file).startswith(package)}
    for source, target in folder_arrows(package):
        below[source].add(target)
    assert not nodes_on_cycles(below)


def test_the_folders_of_bench_have_few_imports_of_each_other() -> None:
    between = {pair for pair in folder_arrows("bench") if not any(name.endswith(".py") for name in pair)}
    assert len(between) <= MAX_ARROWS, sorted(between)


def test_a_folder_has_few_entries_and_a_docstring() -> None:
    folders = {file.parent for file in FILES}
    assert {name_of(folder): count for folder in folders if (count := n_entries(folder)) > MAX_ENTRIES} == {}
    assert [name_of(folder) for folder in folders if not ast.get_docstring(parsed(folder / "__init__.py"))] == []


def n_entries(folder: Path) -> int:
    files = {file for file in folder.glob("*.py") if file.name != "__init__.py"}
    return len(files) + sum((path / "__init__.py").is_file() for path in folder.iterdir())


@pytest.mark.parametrize("library", IMPORTERS)
def test_a_heavy_library_is_imported_only_by_the_files_that_need_it(library: str) -> None:
    users = {name_of(file) for file in FILES if any(module.split(".")[0] == library for _, module, _ in imports(file))}
    assert {user for user in users if not user.startswith(tuple(IMPORTERS[library]))} == set()
    assert [place for place in IMPORTERS[library] if not any(user.startswith(place) for user in users)] == []


def test_files_are_short_and_have_a_docstring() -> None:
    lengths = {name_of(file): len(file.read_text(encoding="utf-8").splitlines()) for file in FILES}
    assert {name: length for name, length in lengths.items() if length > MAX_FILE_LINES} == {}
    assert [name_of(file) for file in FILES if file.stem == "utils" or not ast.get_docstring(parsed(file))] == []


def test_public_functions_have_at_most_five_positional_parameters() -> None:
    too_long = {
        f"{name_of(file)}: {name}": count
        for file in FILES
        if not name_of(file).startswith("bench/cli/")  # typer calls commands by name
        for name, count in positional_counts(parsed(file))
        if count > MAX_POSITIONAL
    }
    assert too_long == {}


def positional_counts(node: ast.AST, is_method: bool = False) -> Iterator[tuple[str, int]]:
    """Yield the name and the number of positional parameters of each public function that is not a kernel."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef) and not child.name.startswith("_"):
            yield from positional_counts(child, is_method=True)
        if not isinstance(child, ast.FunctionDef) or (child.name.startswith("_") and child.name != "__init__"):
            continue
        decorators = " ".join(ast.unparse(decorator) for decorator in child.decorator_list)
        if "njit" not in decorators:
            has_self = is_method and "staticmethod" not in decorators
            yield child.name, len(child.args.posonlyargs) + len(child.args.args) - has_self
