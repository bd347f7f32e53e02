"""Merged runs are one run: each case once, each problem from one machine, and no incomplete result."""

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from proxbench.bench import Run, bundle, load, merge
from proxbench.bench.errors import BenchError
from proxbench.bench.store.bundles.bundle import Bundle, bundle_of_run, write_bundle
from proxbench.bench.store.condition import drift, hosts, session_differences, warnings
from proxbench.bench.store.records import CaseRecord
from proxbench.problems import load as load_problem
from stored_cases import solved_case


def part(packed: Bundle, path: Path, problems: list[str], host: str = "", **plan: Any) -> Path:
    """Write the part of a bundle with some problems, as if measured on a machine with the name ``host``."""
    machine = replace(packed.run.machine, host=host)
    carried = {name: problem for name, problem in packed.carried.items() if name in problems}
    made = replace(
        packed.run,
        plan=replace(packed.run.plan, problems=problems, **plan),
        machine=machine,
        carried={name: problem.digest for name, problem in carried.items()},
        sessions=[replace(session, machine=machine) for session in packed.run.sessions],
    )
    cases = [case for case in packed.cases if case.problem in problems]
    write_bundle(dataclasses.replace(packed, run=made, cases=cases, carried=carried), path)
    return path


def by_case(made: Run) -> dict[tuple[str, str], CaseRecord]:
    return {(case.problem, case.solver): case for case in bundle_of_run(made.folder).cases}


@pytest.fixture
def parts(honest: Bundle, tmp_path: Path) -> list[Path]:
    """Two shards of the run, from two machines."""
    return [
        part(honest, tmp_path / "1.bundle", ["sliding pair", "hard-groove"], "one", shard="1/2"),
        part(honest, tmp_path / "2.bundle", ["funnel-30"], "two", shard="2/2"),
    ]


def test_merging_a_single_bundle_restores_its_run(made: Run, file: Path, tmp_path: Path) -> None:
    again = merge(file, tmp_path, "it")
    assert (again.info, by_case(again)) == (made.info, by_case(made))
    assert again.points.equals(made.points)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_shards_are_the_undivided_run_in_any_order(
    order: tuple[int, ...], made: Run, parts: list[Path], tmp_path: Path
) -> None:
    missing: list[str] = []
    whole = merge([parts[index] for index in order], tmp_path, "whole", on_missing=missing.append)
    assert whole.info.plan == made.info.plan
    assert whole.points.equals(made.points)
    assert whole.is_finished
    assert missing == []


@pytest.mark.parametrize(
    ("shards", "order"),
    [
        (("", ""), ["sliding pair", "hard-groove", "funnel-30"]),
        (("1/2", "1/3"), ["sliding pair", "hard-groove", "funnel-30"]),
        (("1/2", "2/2"), ["sliding pair", "funnel-30", "hard-groove"]),
    ],
)
def test_problems_of_runs_that_are_no_shards_of_one_run_follow_each_other(
    shards: tuple[str, str], order: list[str], honest: Bundle, tmp_path: Path
) -> None:
    names = (["sliding pair", "hard-groove"], ["funnel-30"])
    missing: list[str] = []
    sources = [
        part(honest, tmp_path / f"{number}.bundle", own, shard=shard)
        for number, (own, shard) in enumerate(zip(names, shards, strict=True))
    ]
    assert merge(sources, tmp_path, "both", on_missing=missing.append).info.plan.problems == order
    assert missing == []


def test_merge_is_idempotent(parts: list[Path], tmp_path: Path) -> None:
    whole = merge(parts, tmp_path, "whole")
    again = merge([whole.folder, *parts, bundle(whole, tmp_path / "whole.bundle")], tmp_path, "again")
    assert by_case(again) == by_case(whole)
    assert again.info.sessions == whole.info.sessions


def test_merge_names_a_missing_shard(parts: list[Path], tmp_path: Path) -> None:
    missing: list[str] = []
    merge(parts[1:], tmp_path, "half", on_missing=missing.append)
    assert missing == ["shard 1/2 is missing."]


def test_a_run_merged_without_a_shard_says_so_until_it_is_merged_with_it(honest: Bundle, tmp_path: Path) -> None:
    names = ["sliding pair", "hard-groove", "funnel-30"]
    suite = {"suite": "mine", "requested": ["mine"], "available": 3}
    shards = [
        part(honest, tmp_path / f"{number}.bundle", [name], shard=f"{number}/3", **suite)
        for number, name in enumerate(names, 1)
    ]
    first = merge(shards[1], tmp_path, "first")
    (warning,) = [sentence for sentence in warnings(first) if sentence.startswith("INCOMPLETE")]
    assert "without shards 1/3, 3/3" in warning
    assert first.info.plan.problems_in_words(1) == "1 of 3 problems of mine"
    second = merge([first.folder, shards[2]], tmp_path, "second")
    (warning,) = [sentence for sentence in warnings(second) if sentence.startswith("INCOMPLETE")]
    assert "without shard 1/3" in warning
    assert second.info.plan.problems_in_words(2) == "2 of 3 problems of mine"
    whole = merge([second.folder, shards[0]], tmp_path, "whole")
    assert not [sentence for sentence in warnings(whole) if sentence.startswith("INCOMPLETE")]
    plan = whole.info.plan
    assert (plan.problems, plan.requested, plan.problems_in_words(3)) == (names, ["mine"], "all 3 problems of mine")


@pytest.mark.parametrize(
    ("second", "words"),
    [
        ({"suite": "mine", "requested": ["mine"], "available": 9}, "3 of 9 problems of mine"),
        ({"suite": "mine", "requested": ["mine"], "available": 8}, "3 problems of mine"),
        ({"suite": "other", "requested": ["other"], "available": 9}, "3 problems"),
    ],
)
def test_a_merged_run_of_parts_of_a_suite_is_not_called_the_suite(
    second: dict[str, Any], words: str, honest: Bundle, tmp_path: Path
) -> None:
    mine = {"suite": "mine", "requested": ["mine"], "available": 9, "sample": 2}
    sources = [
        part(honest, tmp_path / "1.bundle", ["sliding pair", "hard-groove"], **mine),
        part(honest, tmp_path / "2.bundle", ["funnel-30"], sample=1, **second),
    ]
    assert merge(sources, tmp_path, "both").info.plan.problems_in_words(3) == words


def test_run_on_several_machines_warns_and_measures_drift_per_machine(parts: list[Path], tmp_path: Path) -> None:
    whole = merge(parts, tmp_path, "whole")
    assert hosts(whole) == {"one": 2, "two": 1}
    assert session_differences(whole) == []
    (said,) = [sentence for sentence in warnings(whole) if sentence.startswith("MACHINES")]
    assert "one: 2 problems, two: 1 problems" in said
    of_host = whole.rounds["session"].map(lambda number: whole.info.sessions[number].machine.host)
    probes = of_host.map({"one": 1e-4, "two": 5e-4})
    assert drift(dataclasses.replace(whole, rounds=whole.rounds.assign(probe_seconds=probes))) == pytest.approx(1.0)


def test_merge_rejects_one_problem_from_different_versions_or_machines(parts: list[Path], tmp_path: Path) -> None:
    whole = merge(parts, tmp_path, "whole")
    first, second = whole.info.sessions
    newer = replace(second, machine=replace(second.machine, versions={**second.machine.versions, "numpy": "99"}))
    info = replace(whole.info, sessions=[first, newer])
    assert [words.split()[0] for words in session_differences(dataclasses.replace(whole, info=info))] == ["numpy"]
    split = whole.rounds.assign(session=whole.rounds["number"] % 2)
    assert session_differences(dataclasses.replace(whole, rounds=split)) == ["machine one, now two"]


def test_solvers_of_one_problem_from_two_machines_are_not_put_together(honest: Bundle, tmp_path: Path) -> None:
    first = [case for case in honest.cases if case.solver in ("NSGS", "SORprox")]
    rest = [case for case in honest.cases if case.solver not in ("NSGS", "SORprox")]
    names = honest.run.plan.problems
    sources = [
        part(dataclasses.replace(honest, cases=cases), tmp_path / f"{host}.bundle", names, host)
        for host, cases in (("one", first), ("two", rest))
    ]
    with pytest.raises(BenchError, match="were measured on different machines, one and two"):
        merge(sources, tmp_path, "both")
    same = [
        part(dataclasses.replace(honest, cases=cases), tmp_path / f"{index}.bundle", names, "one")
        for index, cases in enumerate((first, rest))
    ]
    assert merge(same, tmp_path, "both").is_finished


def test_a_finished_case_counts_before_an_unfinished_one_and_two_are_a_contradiction(
    honest: Bundle, tmp_path: Path
) -> None:
    begun = [solved_case(load_problem("funnel-30"), "NSGS", honest.run.plan.tolerances[:1])]
    names = honest.run.plan.problems
    unfinished = part(dataclasses.replace(honest, cases=begun), tmp_path / "begun.bundle", names)
    whole = part(honest, tmp_path / "whole.bundle", names)
    expected = {(case.problem, case.solver): case for case in honest.cases}
    for number, sources in enumerate(itertools.permutations((unfinished, whole))):
        assert by_case(merge(sources, tmp_path, f"{number}")) == expected
    slower = [replace(case, wall_seconds=case.wall_seconds + 1.0) for case in honest.cases]
    other = part(dataclasses.replace(honest, cases=slower), tmp_path / "slower.bundle", names)
    with pytest.raises(BenchError, match=r"was measured in .* and again in .*; leave one of them out"):
        merge([whole, other], tmp_path, "two")


def test_warm_cases_of_one_problem_that_start_differently_are_not_put_together(honest: Bundle, tmp_path: Path) -> None:
    names, sources = honest.run.plan.problems, list[Path]()
    for number, solver in enumerate(("NSGS", "SORprox")):
        cases = [replace(case, start=f"{number:016x}") for case in honest.cases if case.solver == solver]
        sources.append(part(dataclasses.replace(honest, cases=cases), tmp_path / f"{number}.bundle", names))
    with pytest.raises(BenchError, match="start from other steps or contacts than in another source"):
        merge(sources, tmp_path, "both")
    assert merge(sources[:1], tmp_path, "one").cases["start"].unique().tolist() == ["0" * 16]


@pytest.mark.parametrize(
    ("plan", "word"), [({"passes": 1}, "number of passes"), ({"tolerances": [1e-2, 1e-5, 1e-6]}, "tolerances")]
)
def test_runs_with_different_settings_are_not_merged(
    plan: dict[str, Any], word: str, honest: Bundle, file: Path, tmp_path: Path
) -> None:
    other = part(honest, tmp_path / "other.bundle", honest.run.plan.problems, **plan)
    with pytest.raises(BenchError, match=f"has other {word} than"):
        merge([file, other], tmp_path, "both")


def test_a_source_that_does_not_agree_is_refused_and_nothing_is_written(honest: Bundle, tmp_path: Path) -> None:
    cases = [replace(case, digest="0" * 64) if case.problem == "hard-groove" else case for case in honest.cases]
    odd = tmp_path / "odd.bundle"
    write_bundle(dataclasses.replace(honest, cases=cases), odd)
    with pytest.raises(BenchError, match=r"odd.bundle is rejected: .* \(and 3 more cases\)"):
        merge(odd, tmp_path / "results", "it")
    assert not (tmp_path / "results").exists()


def test_failed_merge_writes_nothing(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("proxbench.bench.store.store.Store.write_run", fail)
    with pytest.raises(BenchError, match="No space left"):
        merge(file, tmp_path / "results", "it")
    assert list((tmp_path / "results").iterdir()) == []
    monkeypatch.undo()
    made = merge(file, tmp_path / "results", "it")
    with pytest.raises(BenchError, match="exists already"):
        merge(file, tmp_path / "results", "it")
    assert load(made).is_finished
    with pytest.raises(BenchError, match="nothing to merge"):
        merge([], tmp_path)
