"""The problems of a run: each has a name, a family and numbers, or is left out with a reason."""

import os
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.measure.plan import make_plan
from proxbench.bench.measure.selection import Selection, problem_name, select, select_shard
from proxbench.problems import ContactProblem, ProblemError, save_problem, write_fclib
from proxbench.problems.exchange.catalog import suite_members
from proxbench.problems.exchange.families import Sampling


def box(weight: float, name: str = "any") -> ContactProblem:
    return ContactProblem.from_delassus(np.eye(3), (-weight, 0.5, 0.0), 0.3, name=name)


def filled(folder: Path, sizes: dict[str, int]) -> Path:
    """Write different problems of one name to a folder, in files whose names begin with their family."""
    for family, size in sizes.items():
        for number in range(size):
            save_problem(box(1.0 + number), folder / f"{family}-{number:03}.npz")
    return folder


def broken(folder: Path) -> Path:
    """Write three unusable files: one damaged, one truncated, and one with a library name and other numbers."""
    (folder / "boxes-damaged.npz").write_bytes(b"no zip")
    write_fclib(box(1.0), folder / "boxes-whole.hdf5")
    (folder / "boxes-cut.hdf5").write_bytes((folder / "boxes-whole.hdf5").read_bytes()[:3000])
    (folder / "boxes-whole.hdf5").unlink()
    save_problem(box(2.0), folder / "funnel-30.npz")
    return folder


@pytest.mark.slow
def test_of_two_hundred_files_three_broken_ones_are_left_out_with_their_reasons(tmp_path: Path) -> None:
    chosen = select(None, str(broken(filled(tmp_path / "mine", {"boxes": 120, "rocks": 77}))))
    assert chosen.suite == "mine"
    assert len(chosen.problems) == 197
    assert Counter(chosen.families.values()) == {"boxes": 120, "rocks": 77}
    assert list(chosen.families) == [problem_name(problem) for problem in chosen.problems]
    assert [sentence.split()[0] for sentence in chosen.left_out] == [
        str(tmp_path / "mine" / name) for name in ("boxes-cut.hdf5", "boxes-damaged.npz", "funnel-30.npz")
    ]
    assert all(sentence.endswith(".") and "\n" not in sentence for sentence in chosen.left_out)
    assert "differs from the problem 'funnel-30' of the library" in chosen.left_out[-1]


def test_a_problem_of_a_folder_has_the_name_of_its_file_and_the_numbers_in_it(tmp_path: Path) -> None:
    chosen = select([filled(tmp_path, {"boxes": 2})], "quick")
    assert [(problem_name(one), one.digest) for one in chosen.problems if not isinstance(one, str)] == [
        ("boxes-000", box(1.0).digest),
        ("boxes-001", box(2.0).digest),
    ]
    assert chosen.suite == ""


def test_names_files_folders_and_problems_are_given_together(tmp_path: Path) -> None:
    folder = filled(tmp_path / "many", {"boxes": 2})
    save_problem(box(5.0, "single-1"), tmp_path / "file.npz")
    mine = box(7.0, "mine-1").renamed("mine-1", family="my own")
    chosen = select(["funnel-30", folder, tmp_path / "file.npz", mine], "quick")
    assert chosen.families == {
        "funnel-30": "funnel",
        "boxes-000": "boxes",
        "boxes-001": "boxes",
        "single-1": "single",
        "mine-1": "my own",
    }
    assert chosen.problems[0] == "funnel-30"  # loaded later
    assert select([mine], "quick").problems == (mine,)


def test_a_sample_is_drawn_before_files_are_read_and_keeps_the_order(tmp_path: Path) -> None:
    folder = filled(tmp_path, {"boxes": 30, "rocks": 10})
    chosen = select(None, folder, sample=8, seed=1)
    assert Counter(chosen.families.values()) == {"boxes": 6, "rocks": 2}
    assert list(chosen.families) == sorted(chosen.families)
    assert select(None, folder, sample=8, seed=1).families == chosen.families
    assert select(None, folder, sample=8, seed=2).families != chosen.families
    for file in folder.glob("*.npz"):
        if file.stem not in chosen.families:
            file.write_bytes(b"never read")
    assert select(None, folder, sample=8, seed=1).left_out == ()


@pytest.mark.parametrize("sampling", ["proportional", "even"])
def test_a_sample_has_its_size_in_spite_of_unreadable_files(sampling: Sampling, tmp_path: Path) -> None:
    folder = filled(tmp_path, {"boxes": 6, "rocks": 2})
    first = select(None, folder, sample=4, seed=1, sampling=sampling).families
    damaged = next(name for name in first if name.startswith("boxes"))
    whole = (folder / f"{damaged}.npz").read_bytes()
    (folder / f"{damaged}.npz").write_bytes(whole[:200] + bytes(20) + whole[220:])
    chosen = select(None, folder, sample=4, seed=1, sampling=sampling)
    assert len(chosen.problems) == 4
    assert Counter(chosen.families.values()) == Counter(first.values())
    assert [one.name for one in chosen.problems if isinstance(one, ContactProblem)] == list(chosen.families)
    assert damaged not in chosen.families
    assert len(chosen.left_out) == 1
    assert damaged in chosen.left_out[0]


def test_a_named_suite_is_sampled_alike() -> None:
    chosen = select(None, "all", sample=20, seed=3)
    assert chosen.suite == "all"
    assert len(chosen.problems) == 20
    assert set(chosen.problems) < set(suite_members("all"))
    assert set(chosen.families.values()) >= {"funnel", "woodpecker", "hard: stacks"}


def test_known_names_take_precedence_over_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("quick", "funnel-30"):
        filled(tmp_path / name, {"boxes": 1})
    assert list(select(None, "quick").problems) == suite_members("quick")
    assert select(["funnel-30"], "quick").problems == ("funnel-30",)
    for place in ("./quick", Path("quick")):
        assert list(select(None, place).families) == ["boxes-000"]


def test_explicitly_named_problems_must_be_valid_and_unique(tmp_path: Path) -> None:
    folder = broken(filled(tmp_path, {"boxes": 1}))
    with pytest.raises(ProblemError, match="is damaged"):
        select([folder / "boxes-damaged.npz"], "quick")
    with pytest.raises(BenchError, match="'boxes-000' is given more than once"):
        select([folder, box(1.0, "boxes-000")], "quick")
    with pytest.raises(BenchError, match="differs from the problem of that name in the library"):
        select([box(1.0, "funnel-30")], "quick")


def test_a_folder_without_a_sound_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"none of 3 problem files can be measured; the first: .*boxes-cut.hdf5"):
        select(None, broken(tmp_path))


@pytest.mark.parametrize("suite", ["nowhere/at/all", Path("nowhere")])
def test_missing_folder_is_reported(suite: str | Path) -> None:
    with pytest.raises(ProblemError, match="there is no folder nowhere"):
        select(None, suite)


def test_pipes_and_broken_links_are_ignored(tmp_path: Path) -> None:
    folder = filled(tmp_path, {"boxes": 1})
    (folder / "link.npz").symlink_to(folder / "nowhere")
    os.mkfifo(folder / "pipe.hdf5")
    chosen = select(None, folder)
    assert (list(chosen.families), chosen.left_out) == (["boxes-000"], ())


@pytest.mark.parametrize("count", [1, 3, 7])
def test_shards_deal_out_each_problem_once_with_its_family(count: int) -> None:
    whole = select(None, "woodpecker")
    shards = [select_shard(whole, f"{number}/{count}")[0] for number in range(1, count + 1)]
    assert sorted(name for shard in shards for name in map(problem_name, shard.problems)) == sorted(whole.problems)
    assert {name: family for shard in shards for name, family in shard.families.items()} == whole.families
    assert [problem_name(shard.problems[0]) for shard in shards] == list(whole.problems[:count])
    assert max(len(shard.problems) for shard in shards) - min(len(shard.problems) for shard in shards) <= 1


@pytest.mark.parametrize("shard", ["0/2", "3/2", "1/0", "2", "1/2/3", "-1/2", "a/b", "1/ 2", "", "1/999999"])
def test_a_malformed_shard_is_refused(shard: str) -> None:
    with pytest.raises(BenchError, match="must be i/n"):
        select_shard(Selection(("a", "b"), {}), shard)


def test_a_shard_without_a_problem_is_refused() -> None:
    with pytest.raises(BenchError, match=r"has none of the problems \(2 in all\); use fewer shards"):
        select_shard(Selection(("a", "b"), {}), "3/3")


def test_leading_zeros_of_a_shard_are_ignored() -> None:
    plan = make_plan(["hard-groove", "hard-counterexample"], ["NSGS"], shard="01/2")
    assert plan.record.shard == "1/2"
    assert plan.problems == ("hard-groove",)


@pytest.mark.parametrize("given", [[np.eye(3)], [5], [None]])
def test_objects_other_than_names_files_and_problems_are_refused(given: Any) -> None:
    with pytest.raises(ProblemError, match=r"^`problems` must be names, files or contact problems, not "):
        select(given, "quick")


def test_a_file_that_is_not_a_problem_file_is_refused_as_such(tmp_path: Path) -> None:
    np.save(tmp_path / "g.npy", np.eye(3))
    with pytest.raises(ProblemError, match=r"g\.npy is not a problem file, whose name ends in \.npz"):
        select([str(tmp_path / "g.npy")], "quick")


def test_a_sample_and_a_shard_know_of_how_many_problems_they_are_a_part() -> None:
    drawn = select(None, "woodpecker", sample=4)
    part, _ = select_shard(drawn, "1/2")
    assert (len(part.problems), len(drawn.problems)) == (2, 4)
    assert part.available == drawn.available == len(select(None, "woodpecker").problems)
