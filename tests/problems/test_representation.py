"""Representations of objects are short, contain the essential data, and are escaped in notebooks."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, Laws, Verdict, judge, load
from proxbench.problems.contact.solver import Solution, Status
from proxbench.problems.representation import MAX_LISTED, counted, html_table, names_or_number

MAX_LINE_LENGTH = 120
MAX_TABLE_LENGTH = 2500
HOSTILE = "<script>alert(1)</script>"

PROBLEM = load("funnel-100")
VERDICT = judge(PROBLEM, np.zeros(PROBLEM.n_rows))
SOLUTION = Solution(np.zeros(PROBLEM.n_rows), Status.SOLVED, 104)


@pytest.mark.parametrize(
    ("shown", "facts"),
    [
        (PROBLEM, ["funnel-100", "contacts", "rows", "W and M⁻¹"]),
        (PROBLEM.laws, ["unilateral", "spatial friction"]),
        (VERDICT, [f"residual {VERDICT.residual:.3g}", "coulomb"]),
        (SOLUTION, ["solved", f"{PROBLEM.n_rows} rows", "104 iterations"]),
    ],
)
def test_a_representation_is_one_short_line_with_the_essential(
    shown: ContactProblem | Laws | Verdict | Solution, facts: list[str]
) -> None:
    text = repr(shown)
    assert len(text) <= MAX_LINE_LENGTH
    assert "\n" not in text
    assert [fact for fact in facts if fact not in text] == []
    page = shown._repr_html_()
    assert page.startswith("<table>")
    assert len(page) <= MAX_TABLE_LENGTH


def test_a_verdict_shows_all_its_numbers_with_units_in_a_notebook() -> None:
    page = VERDICT._repr_html_()
    assert "penetration velocity [m/s]" in page
    assert f"{VERDICT.penetration_velocity:.4g}" in page
    assert "velocity error" not in page  # the problem knows no velocity


def test_an_infeasible_verdict_says_so() -> None:
    problem = ContactProblem.from_delassus([[0.0]], [-1.0], dim=1)
    assert "infeasible" in repr(judge(problem, [0.0]))


def test_a_message_of_a_solution_is_shown() -> None:
    solution = Solution(np.zeros(1), Status.UNSUPPORTED, 0, "one row is not enough")
    assert repr(solution) == "<Solution unsupported: 1 row, 0 iterations; one row is not enough>"
    assert "one row is not enough" in solution._repr_html_()


def test_names_of_a_problem_and_messages_are_escaped() -> None:
    problem = PROBLEM.renamed(HOSTILE, scene=HOSTILE)
    solution = Solution(np.zeros(1), Status.SOLVED, 1, HOSTILE)
    for page in (problem._repr_html_(), solution._repr_html_(), html_table(HOSTILE, {HOSTILE: HOSTILE})):
        assert "<script" not in page
        assert "&lt;script" in page


def test_nouns_are_singular_or_plural_according_to_their_count() -> None:
    assert [counted(1, "row"), counted(2, "row"), counted(2, "pass", "passes")] == ["1 row", "2 rows", "2 passes"]


def test_long_lists_of_names_are_replaced_by_their_number() -> None:
    names = [f"solver-{number}" for number in range(MAX_LISTED + 1)]
    assert names_or_number(names[:2], "solver") == "solver-0, solver-1"
    assert names_or_number(names, "solver") == f"{MAX_LISTED + 1} solvers"
    assert names_or_number([], "solver") == "0 solvers"
