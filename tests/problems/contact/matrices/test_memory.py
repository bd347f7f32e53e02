"""Insufficient memory is reported in one sentence before an array is allocated."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import ContactProblem, ProxbenchError, load
from proxbench.problems.contact.matrices import delassus, memory
from proxbench.problems.contact.matrices.delassus import _block_count_bounds
from proxbench.problems.errors import InsufficientMemoryError
from proxbench.solvers import Status, Stop, create

STATISTICS = "anon 1\nactive_file 100\ninactive_file 150\nslab_reclaimable 50\n"

GROUP_FILES = {
    "2": {"memory.max": "1000\n", "memory.current": "900\n", "memory.stat": STATISTICS},
    "1": {"memory.limit_in_bytes": "1000\n", "memory.usage_in_bytes": "900\n", "memory.stat": STATISTICS},
}
"""Files of a control group, by version of control groups; 400 bytes are available."""


@pytest.fixture
def leave(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Return a function that limits the available memory [bytes], which is then checked before every allocation."""

    def leave_bytes(available: float) -> None:
        for module in (memory, delassus):
            monkeypatch.setattr(module, "available_bytes", lambda: available)
            monkeypatch.setattr(module, "SMALL_BYTES", 0)

    return leave_bytes


def grains_on_slab(n_grains: int) -> ContactProblem:
    """Return grains at rest on one movable slab, so that all pairs of contacts are coupled."""
    grain = np.arange(n_grains)
    rows = np.concatenate([3 * grain + k for k in (2, 0, 1)])
    dofs = [np.concatenate([3 * grain + k for k in range(3)]), np.repeat(3 * n_grains + np.arange(3), n_grains)]
    signs = np.repeat([1.0, -1.0], 3 * n_grains)
    entries = (signs, (np.concatenate(dofs), np.tile(rows, 2)))
    directions = sp.csc_array(entries, shape=(3 * n_grains + 3, 3 * n_grains))
    c = np.tile([-0.01, 0.0, 0.0], n_grains)
    return ContactProblem.from_factors(directions, np.ones(3 * n_grains + 3), c, 0.5, name="slab")


def test_a_matrix_that_no_machine_holds_is_refused_before_it_is_counted() -> None:
    """64 000 grains on one slab take 311 GB in blocks; counting them would take half a minute."""
    with pytest.raises(InsufficientMemoryError) as raised:
        grains_on_slab(64_000).delassus_blocks()
    message = str(raised.value)
    assert message.startswith("at least 311 GB of memory is needed for G of 64,000 contacts, but ")
    assert message.endswith(" GB is available; use a solver over the factors, such as SORprox(form='factors').")
    assert isinstance(raised.value, ProxbenchError)
    assert isinstance(raised.value, MemoryError)


@pytest.mark.parametrize("name", ["funnel-300", "pile-100", "bodies-stack-10", "sequence-chain-20-1"])
def test_bounds_enclose_the_number_of_blocks(name: str) -> None:
    problem = load(name) if "chain" not in name else load("bodies-chain-20")
    least, most = _block_count_bounds(problem.factor_pieces())
    assert least <= len(problem.delassus_blocks().columns) <= most


def test_between_the_bounds_the_blocks_are_counted(leave: Callable[[float], None]) -> None:
    least, _ = _block_count_bounds(load("funnel-300").factor_pieces())
    n_blocks = len(load("funnel-300").delassus_blocks().columns)
    assert least < n_blocks - 1
    leave(76.0 * n_blocks - 1)
    with pytest.raises(InsufficientMemoryError, match="for G of 344 contacts"):
        load("funnel-300").delassus_blocks()
    leave(76.0 * n_blocks)
    assert len(load("funnel-300").delassus_blocks().columns) == n_blocks
    with pytest.raises(InsufficientMemoryError, match="for G of 344 contacts"):
        load("funnel-300").delassus()  # as a sparse matrix in addition


@pytest.mark.parametrize("solver", ["SORprox(form='delassus')", "NSGS", "InteriorPoint", "SemismoothNewton", "Lemke"])
def test_solvers_that_need_more_memory_say_so_in_prepare(solver: str, leave: Callable[[float], None]) -> None:
    problem = load("funnel-100")
    leave(1000.0)
    with pytest.raises(InsufficientMemoryError, match=r"at least .* GB is available; use"):
        create(solver).prepare(problem)


def test_systems_and_factors_are_refused_before_they_are_allocated(leave: Callable[[float], None]) -> None:
    problem = load("funnel-100")
    problem.delassus_blocks()
    leave(1000.0)
    with pytest.raises(InsufficientMemoryError, match="for the system of interior points, "):
        create("InteriorPoint").prepare(problem)
    with pytest.raises(InsufficientMemoryError, match=r"for triangular factors, .* without factorisations"):
        create("InteriorPoint(form='factors')").prepare(problem)


def test_robust_continues_with_sweeps_if_memory_allows_no_other_method(leave: Callable[[float], None]) -> None:
    """Sweeps over the factors need neither G nor a factorisation."""
    problem = grains_on_slab(300)
    leave(1000.0)
    solution = create("Robust").prepare(problem).solve(Stop(1e-15, 5000, 60.0))
    assert solution.status in (Status.STALLED, Status.ITERATION_LIMIT, Status.TIME_LIMIT)
    assert "Newton steps: at least" in solution.message
    assert np.isfinite(solution.impulses).all()
    assert create("Robust").prepare(problem).solve(Stop(1e-2)).status is Status.SOLVED


def test_a_dense_matrix_is_refused(leave: Callable[[float], None]) -> None:
    leave(799.0)
    with pytest.raises(InsufficientMemoryError, match=r"8e-07 GB of memory is needed for a dense G of 10 rows.*; go"):
        memory.to_dense(sp.eye_array(10, format="csr"), "go on")
    leave(800.0)
    assert memory.to_dense(sp.eye_array(10, format="csr"), "").shape == (10, 10)


@pytest.mark.parametrize(("version", "line"), [("2", "0::/inner"), ("1", "7:cpu:/\n6:hugetlb,memory:/inner")])
def test_control_groups_restrict_the_memory(
    version: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files in memory can be dropped; a group without a limit has the text "max", or a number beyond any memory."""
    folder = tmp_path if version == "2" else tmp_path / "memory"
    folder.mkdir(exist_ok=True)
    for name, text in GROUP_FILES[version].items():
        (folder / name).write_text(text)
    monkeypatch.setattr(memory, "_GROUPS", tmp_path)
    replace_file(monkeypatch, "/proc/self/cgroup", f"{line}\n")
    assert memory.available_bytes() == 400.0
    if version == "2":
        (folder / "memory.max").write_text("max\n")
    else:
        (folder / "memory.limit_in_bytes").write_text("9223372036854771712\n")
    assert memory.available_bytes() > 2**20


def replace_file(monkeypatch: pytest.MonkeyPatch, replaced: str, text: str | None) -> None:
    """Replace the text of a file, or remove it."""
    read = Path.read_text

    def read_text(path: Path, *arguments: Any, **options: Any) -> str:
        if str(path) != replaced:
            return read(path, *arguments, **options)
        if text is None:
            raise FileNotFoundError(path)
        return text

    monkeypatch.setattr(Path, "read_text", read_text)


def test_the_limit_of_the_address_space_restricts_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (1, 1))
    assert memory.available_bytes() == 0.0


def test_a_system_without_a_report_of_its_memory_has_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    replace_file(monkeypatch, "/proc/meminfo", None)
    assert 2**28 < memory._machine_bytes() < np.inf
