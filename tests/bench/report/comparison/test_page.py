"""A comparison is shown as Markdown and JSON, with names from others escaped."""

import json
from pathlib import Path

import pytest
from proxbench.bench import compare
from proxbench.bench.report.comparison.comparison import Comparison
from proxbench.bench.report.comparison.page import comparison_document, markdown_page
from simulated_runs import simulated_cases, store_run

NAME = "<b>|A</b>"


@pytest.fixture
def comparison(tmp_path: Path) -> Comparison:
    solvers = (NAME, "B", "C", "D")
    before = store_run(tmp_path / "before", simulated_cases(0, solvers=solvers))
    return compare(before, store_run(tmp_path / "after", simulated_cases(1, {NAME: 2.0}, solvers=solvers)))


@pytest.mark.slow
def test_markdown_begins_with_the_verdict_and_has_all_cases(comparison: Comparison) -> None:
    failures = comparison.failures("time>10%")
    page = markdown_page(comparison, failures)
    lines = page.splitlines()
    assert lines[0] == "### Proxbench: before → after"
    assert lines[2].startswith(r"**slower: &lt;b&gt;\|A&lt;/b&gt; (")
    assert NAME not in page
    assert sum(line.startswith("| B | p-") for line in lines) == 8
    widths = {line.count(" | ") for line in lines if line.startswith("| ") and "problems" not in line}
    assert len(widths) <= 2
    assert any(line.startswith("❌ time&gt;10%: ") for line in lines)


def test_json_has_the_frames(comparison: Comparison) -> None:
    shown = json.loads(json.dumps(comparison_document(comparison, [])))
    assert shown["verdict"] == comparison.verdict
    assert {len(shown["solvers"]), len(comparison.solvers)} == {4}
    assert shown["scale"] == comparison.scale
