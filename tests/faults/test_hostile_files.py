"""Untrusted files and names cannot run code, write elsewhere, or send control text to a terminal or a browser."""

import hashlib
import io
import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from proxbench.bench import load, resume, run
from proxbench.bench.errors import BenchError
from proxbench.bench.report.charts.problems import write_charts
from proxbench.bench.report.tables import print_tables, write_tables
from proxbench.bench.store.store import MAX_FILE_BYTES, Store
from proxbench.problems import load as load_problem
from rich.console import Console

HOSTILE = "../../<script>alert(1)</script>|\x1b]0;owned\x07 \u202e'=cmd()"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    problem = load_problem("funnel-30").renamed(HOSTILE)
    results = tmp_path_factory.mktemp("results")
    return run([problem], ["SORprox"], results=results, run_id="it", tolerances=[1e-1, 1e-2], passes=1).folder


@pytest.fixture
def copied(stored: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(stored, tmp_path / "deep" / "it"))


def forge(file: Path, changes: dict[str, Any]) -> None:
    """Rewrite a file with changes and a correct checksum, as an attacker might."""
    content = {**json.loads(file.read_text()), **changes}
    del content["checksum"]
    checksum = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    file.write_text(json.dumps({**content, "checksum": checksum}))


def test_a_hostile_name_stays_in_its_folder_and_is_shown_harmlessly(copied: Path) -> None:
    before = set(copied.parents[1].rglob("*"))
    frames = load(copied)
    assert frames.damaged == []
    text = io.StringIO()
    print_tables(frames, Console(file=text, width=120))
    files = [*write_tables(frames, copied), *write_charts(frames, copied)]
    assert set(copied.parents[1].rglob("*")) - before == set(files)
    for file in files:
        assert file.parent == copied
    pages = [file.read_text() for file in files if file.suffix in (".md", ".svg")]
    assert len(pages) == 9
    for page in (*pages, text.getvalue()):
        assert not set("\x1b\x07\u202e") & set(page)
    for page in pages:
        assert "<script" not in page


def test_a_case_under_another_name_does_not_leave_the_folder(copied: Path) -> None:
    (case,), _ = Store.open(copied).read_cases()
    Store(copied).write_case(replace(case, problem="/etc/passwd", solver="../../../run"))
    assert [file.parent for file in copied.rglob("*etc*")] == [copied / "cases"]
    forge(next((copied / "cases").glob("etc*.json")), {"problem": "elsewhere"})
    assert len(load(copied).damaged) == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"points": [{"tolerance": "0.1"}]},
        {"points": [[]]},
        {"points": None},
        {"curve": {"iteration": [1], "residual": []}},
        {"curve": {"iteration": ["1"], "residual": ["__import__('os')"]}},
        {"outcome": {"measured": 1}},
        {"wall_seconds": 10**400},
        {"n_rows": -1},
        {"stderr": 3},
        {"wall_seconds": float("nan")},
        {"wall_seconds": float("inf")},
        {"wall_seconds": None},
        {"peak_memory_bytes": 2**63},
        {"has_iterates": 1},
        {"n_contacts": 1.5},
        {"points": [{"tolerance": 0.1, "outcome": "solved", "status": "", "reason": "", "measured": {}}]},
        {"curve": {"iteration": [1], "residual": [float("nan")]}},
    ],
)
def test_a_case_file_with_invalid_values_is_reported_as_damaged(copied: Path, changes: dict[str, Any]) -> None:
    forge(next((copied / "cases").glob("*.json")), changes)
    frames = load(copied)
    assert len(frames.cases) == 0
    assert len(frames.damaged) == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"plan": {}},
        {"plan": None},
        {"plugins": [{"file": ["elsewhere/evil.py"]}]},
        {"sessions": [{"started": "", "busy_cores": "many"}]},
        {"carried": {"mine": "../../elsewhere"}},
        {"machine": {}},
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(copied: Path, changes: dict[str, Any]) -> None:
    forge(copied / "run.json", changes)
    for act in (load, resume):
        with pytest.raises(BenchError, match=r"the value of its .* is invalid"):
            act(copied)


def test_loading_a_foreign_run_executes_no_plugin(copied: Path) -> None:
    trap, sprung = copied / "trap.py", copied / "sprung"
    trap.write_text(f"open({str(sprung)!r}, 'w')\nSOLVERS = []\n")
    entry = {"kind": "solver", "name": "Trap", "source": "", "file": str(trap), "sha256": "0"}
    forge(copied / "run.json", {"plugins": [entry]})
    with pytest.raises(BenchError, match="name it with `plugins`"):
        resume(copied)
    load(copied)
    assert not sprung.exists()


def test_irregular_huge_and_malformed_case_files_are_reported_as_damaged(copied: Path) -> None:
    cases = copied / "cases"
    os.mkfifo(cases / "pipe.json")
    (cases / "folder.json").mkdir()
    (cases / "deep.json").write_text("[" * 200_000)
    (cases / "digits.json").write_text("9" * 100_000)
    (cases / "bytes.json").write_bytes(b"\xff\xfe\x00")
    (cases / "device.json").symlink_to("/dev/zero")
    with (cases / "huge.json").open("wb") as file:
        file.truncate(MAX_FILE_BYTES + 1)
    frames = load(copied)
    assert len(frames.cases) == 1
    assert len(frames.damaged) == 7
    assert all("\n" not in sentence for sentence in frames.damaged)
