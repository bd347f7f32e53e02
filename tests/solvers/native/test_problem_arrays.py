"""The plain arrays of a problem represent it in every form, and the structures agree with the header."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from native_builds import build_in_c, build_in_cpp
from proxbench.problems import judge, load
from proxbench.problems.contact.problem import ContactProblem
from proxbench.problems.contact.residual import Residual
from proxbench.solvers.native.problem_arrays import ProblemArrays
from proxbench.solvers.native.structures import (
    ARRAYS,
    BLOCKS,
    DENSE,
    FACTORS,
    SCALES,
    SPARSE,
    Description,
    Problem,
    Request,
    Result,
)

ALL = SCALES | DENSE | SPARSE | BLOCKS | FACTORS
PROBLEMS = ("hard-stack-10", "hard-mixed-laws", "hard-linked-2-axes", "funnel-30")


def array(arrays: ProblemArrays, name: str, count: int) -> Any:
    kind = ctypes.c_double if ARRAYS[name] == "d" else ctypes.c_int32
    address = getattr(arrays.structure, name)
    return np.ctypeslib.as_array((kind * count).from_address(address)).copy()


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_form_holds_the_same_matrix(name: str) -> None:
    problem = load(name)
    arrays = ProblemArrays.of(problem, ALL)
    n, structure, wanted = problem.n_rows, arrays.structure, problem.delassus().toarray()
    assert np.array_equal(array(arrays, "dense", n * n).reshape(n, n), wanted)
    starts = array(arrays, "row_starts", n + 1)
    parts = array(arrays, "values", starts[-1]), array(arrays, "columns", starts[-1]), starts
    assert np.array_equal(sp.csr_array(parts, shape=(n, n)).toarray(), wanted)
    assert np.array_equal(array(arrays, "diagonal", n), wanted.diagonal())
    width, lanes = structure.width, structure.n_blocks * structure.width
    starts, slot = array(arrays, "block_starts", structure.n_blocks + 1), array(arrays, "slot", n)
    values = array(arrays, "block_values", starts[-1] * width * width).reshape(-1, width, width)
    blocks = sp.bsr_array((values, array(arrays, "block_columns", starts[-1]), starts), shape=(lanes, lanes)).toarray()
    assert np.array_equal(blocks[slot][:, slot], wanted)
    assert bool(structure.forms & FACTORS) == (problem.factors is not None)
    if problem.factors is not None:
        starts, dofs = array(arrays, "w_starts", n + 1), structure.n_dofs
        parts = array(arrays, "w_values", starts[-1]), array(arrays, "w_dofs", starts[-1]), starts
        directions = sp.csc_array(parts, shape=(dofs, n)).toarray()
        starts = array(arrays, "mass_starts", dofs + 1)
        parts = array(arrays, "mass_values", starts[-1]), array(arrays, "mass_columns", starts[-1]), starts
        inverse = sp.csr_array(parts, shape=(dofs, dofs)).toarray()
        assert np.allclose(directions.T @ inverse @ directions, wanted, rtol=0, atol=1e-12 * abs(wanted).max())


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_laws_and_the_scales_are_those_of_the_judge(name: str) -> None:
    """The residual of the header, computed from the arrays alone, is the judge's."""
    problem = load(name)
    arrays, laws = ProblemArrays.of(problem, SCALES), problem.laws
    alpha, weight = (array(arrays, one, laws.n_laws) for one in ("alpha", "weight"))
    assert np.array_equal(array(arrays, "partner", laws.n_laws), laws.partner)
    impulses = np.abs(np.random.default_rng(1).normal(size=problem.n_rows)) * Residual(problem).scale / alpha.max()
    velocity, largest = problem.relative_velocity(impulses), 0.0
    for law in range(laws.n_laws):
        kind, count, first = (array(arrays, one, laws.n_laws)[law] for one in ("set", "row_count", "first_row"))
        rows = slice(first, first + count)
        moved = alpha[law] * impulses[rows] - velocity[rows]
        bound = alpha[law] * laws.friction_bounds(impulses)[law]
        if kind == 0:
            moved = np.maximum(moved, 0.0)
        elif kind == 2 and np.linalg.norm(moved) > bound:
            moved = bound * moved / np.linalg.norm(moved)
        largest = max(largest, weight[law] * float(np.linalg.norm(alpha[law] * impulses[rows] - moved)))
    assert largest == pytest.approx(judge(problem, impulses).residual, rel=1e-10)


def test_a_message_holds_the_same_numbers_at_offsets() -> None:
    problem = load("hard-mixed-laws")
    arrays = ProblemArrays.of(problem, ALL)
    message = arrays.message()
    sent = Problem.from_buffer_copy(message)
    offset = sent.free_velocity
    assert np.array_equal(np.frombuffer(message, np.float64, problem.n_rows, offset), problem.free_velocity)
    assert all(getattr(sent, name) % 8 == 0 for name in ARRAYS if getattr(sent, name))


def test_a_problem_that_holds_its_matrix_alone_has_no_factors() -> None:
    problem = ContactProblem.from_delassus(np.eye(3), -np.ones(3), 0.5)
    assert ProblemArrays.of(problem, ALL).structure.forms == ALL & ~FACTORS


def test_the_structures_have_the_layout_of_the_header(tmp_path: Path) -> None:
    """Sizes and offsets are compared with those of the C compiler."""
    kinds = {"description": Description, "problem": Problem, "request": Request, "result": Result}
    lines = ['#include "proxbench.h"', "#include <stddef.h>", "#include <stdio.h>", "int main(void) {"]
    wanted = []
    for name, kind in kinds.items():
        lines.append(f'printf("%zu\\n", sizeof(pb_{name}));')
        wanted.append(ctypes.sizeof(kind))
        for field in kind._fields_:
            lines.append(f'printf("%zu\\n", offsetof(pb_{name}, {field[0]}));')
            wanted.append(getattr(kind, field[0]).offset)
    source = tmp_path / "layout.c"
    source.write_text("\n".join([*lines, "return 0; }"]))
    done = subprocess.run([build_in_c(tmp_path / "layout", source)], capture_output=True, text=True, check=True)
    assert list(map(int, done.stdout.split())) == wanted


def test_the_header_also_compiles_as_cpp(tmp_path: Path) -> None:
    source = tmp_path / "empty.cpp"
    source.write_text('#include "proxbench.h"\nint main() { return PB_SOLVED; }\n')
    assert build_in_cpp(tmp_path / "empty", source).exists()
