"""Inconsistent runs are not packed into bundles."""

from pathlib import Path

import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.store.bundles.bundle import bundle_of_run
from proxbench.bench.store.records import CaseRecord
from proxbench.problems.contact.judge import JUDGE
from simulated_runs import solved_point, store_run
from stored_cases import case_record, timed_round


def case(session: int = 0) -> CaseRecord:
    return case_record(points=[solved_point(1e-2, [timed_round(0, 1.0, session=session)])])


@pytest.mark.parametrize(
    ("cases", "reason"),
    [
        ([], "has no measured case"),
        ([case(session=1)], "refers to a session that its run lacks"),
        ([case()], "has no impulses"),
    ],
)
def test_a_run_whose_parts_do_not_fit_is_refused_with_the_reason(
    cases: list[CaseRecord], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(BenchError, match=reason):
        bundle_of_run(store_run(tmp_path / "run", cases, judge=JUDGE))


def test_a_run_with_a_damaged_file_is_refused_with_its_name(tmp_path: Path) -> None:
    folder = store_run(tmp_path / "run", [case()])
    (file,) = (folder / "cases").rglob("*.json")
    file.write_text(file.read_text()[:-9])
    with pytest.raises(BenchError, match=rf"cannot be packed: {file.name} is damaged .*; resume the run to measure"):
        bundle_of_run(folder)
