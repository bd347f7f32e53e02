"""Numbers that a page quotes from another page, or from the package, agree with their source."""

import re
from pathlib import Path

from proxbench.problems.exchange.catalog import suite_members

ROOT = Path(__file__).parents[2]


def page(name: str) -> str:
    return (ROOT / name).read_text()


def table(text: str, first_head: str) -> list[dict[str, str]]:
    """Return the rows of the first Markdown table with this first heading; empty cells repeat the one above."""
    lines = (line.strip() for line in text.splitlines())
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    begin = next(index for index, row in enumerate(cells) if row[0] == first_head)
    heads, rows = cells[begin], list[dict[str, str]]()
    for row in cells[begin + 2 :]:
        if len(row) != len(heads):
            break
        above = rows[-1] if rows else {}
        rows.append({head: cell or above.get(head, "") for head, cell in zip(heads, row, strict=True)})
    return rows


def test_the_home_page_counts_the_problems_of_the_results_and_those_of_the_package() -> None:
    counts = re.search(r"on (\d+) of the (\d+) built-in problems and (\w+) FCLIB files", page("docs/index.md"))
    assert counts is not None
    n_measured, n_builtin, n_files = counts.groups()
    assert int(n_builtin) == len(suite_members("all"))
    assert n_files == "five"
    assert f"all, {int(n_measured) + 5}" in page("docs/results.md")


def test_the_readme_and_the_changelog_count_the_problems_of_their_suites() -> None:
    assert f"{len(suite_members('hard'))} hard cases" in " ".join(page("README.md").split())
    changelog = page("CHANGELOG.md")
    assert f"{len(suite_members('hard'))} hard cases" in changelog
    assert f"{len(suite_members('bodies'))} contact problems" in changelog


def test_times_of_a_pour_in_the_guide_are_those_of_the_results() -> None:
    section = page("docs/results.md").partition("### Which tolerance a pour needs")[2]
    rows = [row for row in table(section, "balls") if row.get("Δt", "1 ms") == "1 ms"]
    measured = {(row["balls"], row["tolerance"]): row["time of a step"].partition(" (")[0] for row in rows}
    guide = page("docs/how-to/choose-a-tolerance.md").partition("## What accuracy costs")[2]
    quoted = {
        (row["balls"], tolerance): cell.partition(",")[0]
        for row in table(guide, "balls")
        for tolerance, cell in row.items()
        if tolerance != "balls" and cell != "–"
    }
    assert len(quoted) == 11
    assert quoted == {name: measured[name] for name in quoted}
