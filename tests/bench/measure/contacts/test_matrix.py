"""The matrix reports the ending of every solver on every problem, and the reason for each failure."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cheating_solvers import Answering, LateInPrepare
from handmade_fclib import M, W, global_data, local_data, matrix_data, write_data
from misbehaving_solvers import Misbehaving
from proxbench.bench.cli.main import run_command
from proxbench.bench.measure.contacts.matrix import default_solvers, measure_matrix
from proxbench.bench.report.matrix import count_bad, matrix_page, matrix_table
from proxbench.bench.store.outcome import Cell, Outcome
from proxbench.solvers import Stop, available

PROBLEMS = ["hard-groove", "hard-sticking-box", "hard-squeezed", "hard-counterexample"]
SOLVERS = ["SORprox", "Enumeration", "ClarabelSOCP"]


@pytest.fixture(scope="module")
def cells() -> list[Cell]:
    return measure_matrix(PROBLEMS, SOLVERS, Stop(1e-8, 10_000, 2.0))


def cell(cells: list[Cell], problem: str, solver: str) -> Cell:
    return next(found for found in cells if (found.problem, found.solver) == (problem, solver))


def test_every_registered_solver_takes_part() -> None:
    assert {name.partition("(")[0] for name in default_solvers()} >= set(available())


@pytest.mark.slow
def test_each_cell_has_an_outcome_and_a_reason(cells: list[Cell]) -> None:
    assert len(cells) == len(PROBLEMS) * len(SOLVERS)
    solved = cell(cells, "hard-groove", "SORprox")
    assert solved.outcome is Outcome.SOLVED
    assert solved.reason == ""
    assert solved.residual <= 1e-8
    assert solved.answer_error is not None
    assert solved.answer_error <= 1e-5
    assert "cycle" in cell(cells, "hard-counterexample", "SORprox").reason
    assert cell(cells, "hard-sticking-box", "Enumeration").outcome is Outcome.UNSUPPORTED
    assert cell(cells, "hard-counterexample", "ClarabelSOCP").outcome is Outcome.RELAXED
    assert all(found.reason for found in cells if found.outcome is not Outcome.SOLVED)
    assert count_bad(cells) == 0


def test_the_page_has_every_problem_every_solver_and_every_reason(cells: list[Cell]) -> None:
    page = matrix_page(cells, 1e-8, "proxbench matrix")
    assert "| hard-counterexample | O −2 | ✓ | R −1 |" in page
    assert "* hard-squeezed: it has no solution, and no solver claims one." in page
    assert all(f"`{solver}`" in page for solver in SOLVERS)
    assert "it has spatial friction, whose directions of slip cannot be enumerated" in page


def test_the_table_has_every_cell_with_the_order_of_magnitude_of_its_residual(cells: list[Cell]) -> None:
    table = matrix_table(cells).set_index("problem")
    assert list(table.columns) == ["family", *SOLVERS]
    assert list(table.index) == PROBLEMS
    assert list(table.loc["hard-counterexample"]) == ["rods", "oscillating 1e-02", "solved", "relaxed 1e-01"]
    assert table.loc["hard-sticking-box", "Enumeration"] == "unsupported"


def test_a_page_beside_a_table_counts_solved_of_supported_problems_by_family() -> None:
    problems = ("hard-groove", "hard-counterexample", "hard-squeezed")
    outcomes = {"A": [Outcome.SOLVED, Outcome.STALLED, Outcome.UNSUPPORTED], "B": [Outcome.SOLVED] * 3}
    made = [
        Cell(problem, solver, outcome, 3e-5, reason="" if outcome is Outcome.SOLVED else f"{outcome} after 3 steps")
        for solver, ends in outcomes.items()
        for problem, outcome in zip(problems, ends, strict=True)
    ]
    page = matrix_page(made, 1e-8, "proxbench matrix", table="cells.csv")
    assert "[cells.csv](cells.csv) contains the result of every solver on every problem" in page
    assert "| solver | wedges | rods | degenerate |" in page
    assert "| `A` | 1/1 | 0/1 | – |" in page
    assert "| `B` | 1/1 | 1/1 | 1/1 |" in page
    assert "| stalled | 1 | stalled after 3 steps | A |" in page
    assert "hard-groove" not in page


def test_problems_of_bodies_are_generated_and_counted_by_family(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path))
    names = ["bodies-box-sliding", "bodies-box-tipping", "bodies-four-bar"]
    made = measure_matrix(names, ["SORprox"], Stop(1e-6, 10_000, 2.0))
    assert [cell.outcome for cell in made] == [Outcome.SOLVED] * 3
    page = matrix_page(made, 1e-6, "proxbench matrix", table="cells.csv")
    assert "| solver | single bodies | linkages |" in page
    assert "| `SORprox` | 2/2 | 1/1 |" in page
    assert matrix_table(made)["family"].tolist() == ["single bodies", "single bodies", "linkages"]


def test_reasons_that_differ_in_numbers_are_one_row_and_many_solvers_are_counted() -> None:
    made = [
        Cell("hard-groove", f"S{number}", Outcome.STALLED, 1e-3, reason=f"residual {number}.5e-03 after 7 sweeps")
        for number in range(6)
    ]
    assert "| stalled | 6 | residual 0.5e-03 after 7 sweeps | S0, S1, S2 and 3 others |" in matrix_page(made, 1e-8, "")


def test_a_long_reason_is_shortened_to_its_ends() -> None:
    reason = "; ".join(f"part {number}: slow" for number in range(20))
    page = matrix_page([Cell("hard-groove", "S", Outcome.STALLED, 1e-3, reason=reason)], 1e-8, "")
    assert "| part 0: slow; …; part 18: slow; part 19: slow |" in page


def test_a_page_names_bad_outcomes_only_where_there_are_any() -> None:
    solved = Cell("hard-groove", "S", Outcome.SOLVED)
    assert "No solver makes a wrong claim" in matrix_page([solved], 1e-8, "")
    wrong = Cell("hard-groove", "S", Outcome.WRONG, 1.0, reason="the judge finds 1")
    page = matrix_page([solved, wrong, replace(wrong, problem="hard-squeezed", is_finite=False)], 1e-8, "")
    assert "| `S` | 1 | 2 wrong, 1 not finite |" in page
    assert "No cell is" not in page


def test_the_page_names_solvers_that_claim_a_solution_where_there_is_none() -> None:
    honest = Cell("hard-squeezed", "Honest", Outcome.INFEASIBLE, 1.0)
    assert "it has no solution, and no solver claims one." in matrix_page([honest], 1e-8, "")
    wrong = Cell("hard-squeezed", "Wrong", Outcome.WRONG, 1.0, reason="claimed 1e-08, but judged 1.0e+00")
    assert "it has no solution, but `Wrong` wrongly claims one." in matrix_page([honest, wrong], 1e-8, "")


def test_the_page_says_that_no_solver_returns_impulses() -> None:
    page = matrix_page([Cell("unknown", "S", Outcome.UNSUPPORTED, reason="it has rolling friction.")], 1e-8, "")
    assert "* unknown: no solver returns impulses; S: it has rolling friction.\n" in page


def test_the_page_states_the_residual_up_to_which_claims_count() -> None:
    """A claim counts as wrong above ten times the tolerance."""
    page = matrix_page([Cell("hard-groove", "S", Outcome.SOLVED, 8e-6)], 1e-6, "")
    assert "The tolerance is 1e-06." in page
    assert "the judged residual is at most 1e-05" in page


def test_a_false_claim_that_there_is_no_solution_is_wrong() -> None:
    """Known answers and solutions of other solvers refute such claims; hard-squeezed has no solution."""
    names = ["hard-groove", "hard-squeezed"]
    found = measure_matrix(names, [Answering(name="Hopeless")], Stop(1e-6, 100, 5.0))
    assert [cell.outcome for cell in found] == [Outcome.WRONG, Outcome.INFEASIBLE]
    assert count_bad(found) == 1


def test_crashing_solver_affects_only_its_own_cell() -> None:
    found = measure_matrix(["hard-groove", "hard-sticking-box"], [Misbehaving("segfault")], Stop(1e-6, 100, 1.0))
    assert [crashed.outcome for crashed in found] == [Outcome.CRASHED] * 2
    assert count_bad(found) == 2
    assert "crashed" in matrix_page(found, 1e-6, "")


@pytest.mark.slow
@pytest.mark.parametrize("action", ["sleep", pytest.param("prepare for ever", marks=pytest.mark.weekly)])
def test_a_solver_that_hangs_is_ended_a_second_after_its_time_limit(action: str) -> None:
    ended: list[float] = []
    found = measure_matrix(
        ["hard-groove", "hard-sticking-box"],
        [Misbehaving(action)],
        Stop(1e-6, 100, 1.0),
        on_cell=lambda cell: ended.append(time.monotonic()),
    )
    assert [hung.outcome for hung in found] == [Outcome.TIMEOUT] * 2
    assert {hung.reason for hung in found} == {"it did not end at its time limit of 1 s"}
    assert 2.0 < ended[1] - ended[0] < 8.0  # the limit, the grace period, and the start of a process


def test_preparing_counts_towards_the_time_limit_of_a_solve() -> None:
    solver = LateInPrepare()
    (late,) = measure_matrix(["hard-groove"], [solver], Stop(1e-6, 100, 0.02))
    assert late.outcome is Outcome.TIME_LIMIT
    (in_time,) = measure_matrix(["hard-groove"], [solver], Stop(1e-6, 100, 2.0))
    assert in_time.outcome is Outcome.SOLVED


def test_a_solver_that_keeps_its_time_limit_is_not_ended() -> None:
    (found,) = measure_matrix(["hard-groove"], [Misbehaving("whisper")], Stop(1e-6, 100, 1.0))
    assert found.outcome is Outcome.SOLVED


def test_the_command_writes_the_page_or_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = "--tolerance 0.0001 --solve-seconds 2 --max-iterations 900"
    line = ["matrix", "--problem", "hard-groove", "--solver", "SORprox", *limits.split()]
    assert run_command([*line, "--output", str(tmp_path / "page.md")]) == 0
    assert "1 cell, 0 of them wrong or with a failed process" in capsys.readouterr().out
    page = (tmp_path / "page.md").read_text()
    assert f"`proxbench matrix --problem hard-groove --solver SORprox {limits} --output" in page
    assert (tmp_path / "page.csv").read_text() == "problem,family,SORprox\nhard-groove,wedges,solved\n"
    assert run_command([*line, "--output", str(tmp_path / "page.csv")]) == 2
    assert "name a file that ends in .md" in capsys.readouterr().err
    assert run_command([*line, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["outcome"] == "solved"
    assert run_command([*line, "--output", str(tmp_path / "none" / "page.md")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert run_command(["matrix", "--problem", "hard-grove"]) == 2
    assert "hard-groove" in capsys.readouterr().err


def test_folder_sample_is_even_over_families_and_skips_unreadable_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for family in ("boxes", "rocks"):
        (tmp_path / family).mkdir()
    for number in range(6):
        write_data(tmp_path / "boxes" / f"{number}.hdf5", local_data(matrix=W + number * np.eye(6)))
    write_data(tmp_path / "rocks" / "whole.hdf5", local_data())
    half = matrix_data(np.tril(M) + np.eye(6, k=-3), "triplets")
    data = global_data() | {f"fclib_global/M/{name}": value for name, value in half.items()}
    write_data(tmp_path / "rocks" / "half.hdf5", data)
    line = ["matrix", "--suite", str(tmp_path), "--solver", "SORprox", "--sample", "4", "--sampling", "even", "--json"]
    assert run_command(line) == 1
    printed = capsys.readouterr()
    assert sum(len(row["problem"]) == 1 for row in json.loads(printed.out)) == 3  # one box for the unreadable rock
    assert [row["outcome"] for row in json.loads(printed.out)] == 4 * ["solved"]
    assert "half.hdf5: M is asymmetric by" in printed.err
    command = printed.err.split("only its lower triangle has entries; run: proxbench ")[1].splitlines()[0]
    assert run_command([*command.split(), "--output", str(tmp_path / "rocks" / "half.npz")]) == 0
    assert run_command(["matrix", "--problem", str(tmp_path / "rocks" / "half.npz"), "--solver", "SORprox"]) == 0
