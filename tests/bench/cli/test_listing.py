"""The listing reads well whatever the number of contacts, rows and laws."""

import pytest
from proxbench.bench.cli.listing import listed, print_listing


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hard-empty", "0 contacts, 0 rows, no law, factors"),
        ("hard-one-row-closed", "1 contact, 1 row, unilateral, Delassus"),
        ("hard-counterexample", "1 contact, 2 rows, unilateral and planar friction, Delassus"),
    ],
)
def test_a_problem_is_described_by_its_sizes_laws_and_form(
    name: str, words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    rows = [row for row in listed("problems")["problems"] if row["name"] == name]
    print_listing({"problems": rows})
    assert capsys.readouterr().out == f"problems\n  {name}  {words}\n\n"
