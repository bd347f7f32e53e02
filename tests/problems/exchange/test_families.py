"""Problems have their stated family, or that of their name, and samples preserve the proportions of families."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proxbench.problems import ProblemError, load
from proxbench.problems.exchange.catalog import BODY_GROUPS
from proxbench.problems.exchange.families import family_of, sampled
from proxbench.problems.hard import CASE_GROUPS


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("funnel-planar-30", "funnel"),
        ("woodpecker-beak-impact", "woodpecker"),
        ("hard-stack-10", "hard: stacks"),
        ("bodies-stack-10", "bodies: box stacks"),
        ("bodies-pile-1000", "bodies: box piles"),
        ("Box_Stacks-i0035-31-0", "Box_Stacks"),
        ("funnel(balls=30, outlet=4)", "funnel"),
        ("mine", "mine"),
        ("-odd", "-odd"),
    ],
)
def test_a_name_has_the_family_of_its_group_or_its_beginning(name: str, family: str) -> None:
    assert family_of(name) == family


def test_no_group_of_bodies_has_the_name_of_a_group_of_hard_cases() -> None:
    """Pages of one suite omit its name, so equal names would be ambiguous."""
    assert not set(BODY_GROUPS) & set(CASE_GROUPS)


def test_a_problem_has_the_family_that_its_provenance_names() -> None:
    problem = load("hard-sticking-box")
    assert family_of(problem) == "hard: supports"
    assert family_of(problem.renamed("mine-1")) == "mine"
    assert family_of(problem.renamed("mine-1", family="boxes")) == "boxes"


def families_of(sizes: dict[str, int]) -> dict[str, str]:
    return {f"{family}-{number}": family for family, size in sizes.items() for number in range(size)}


@given(
    sizes=st.dictionaries(st.sampled_from("abcdefgh"), st.integers(1, 60), min_size=1),
    count=st.integers(1, 200),
    seed=st.integers(0, 9),
)
def test_a_sample_has_its_size_and_every_family_its_share_to_within_one(
    sizes: dict[str, int], count: int, seed: int
) -> None:
    families = families_of(sizes)
    sample, total = sampled(families, count, seed), len(families)
    wanted = min(count, total)
    assert len(sample) == wanted
    drawn = Counter(families[name] for name in sample)
    for family, size in sizes.items():
        assert abs(drawn[family] - wanted * size / total) < 1.0
    places = [list(families).index(name) for name in sample]
    assert places == sorted(places)
    assert sampled(families, count, seed) == sample


@given(
    sizes=st.dictionaries(st.sampled_from("abcdefgh"), st.integers(1, 60), min_size=1),
    count=st.integers(1, 200),
    seed=st.integers(0, 9),
)
def test_an_even_sample_takes_equally_many_of_each_family_or_all_of_a_small_one(
    sizes: dict[str, int], count: int, seed: int
) -> None:
    families = families_of(sizes)
    sample = sampled(families, count, seed, "even")
    assert len(sample) == min(count, len(families))
    drawn = Counter(families[name] for name in sample)
    most = max(drawn.values())
    for family, size in sizes.items():
        assert drawn[family] == size or drawn[family] >= most - 1


def test_an_even_sample_of_a_library_that_is_nearly_one_family_has_all_families() -> None:
    families = families_of({"stacks": 90, "boxes": 3, "chains": 5, "chute": 2})
    proportional = Counter(families[name] for name in sampled(families, 20, 0))
    even = Counter(families[name] for name in sampled(families, 20, 0, "even"))
    assert proportional["stacks"] == 18
    assert even == {"stacks": 10, "boxes": 3, "chains": 5, "chute": 2}
    with pytest.raises(ProblemError, match="`sampling` 'evenly' is unknown; did you mean 'even'"):
        sampled(families, 20, 0, "evenly")  # type: ignore[arg-type]


def test_samples_vary_with_the_seed_and_draw_all_members_equally_often() -> None:
    families = families_of({"a": 20, "b": 10})
    drawn: Counter[str] = Counter()
    for seed in range(300):
        drawn.update(sampled(families, 6, seed))
    assert len(drawn) == 30
    assert 30 < min(drawn.values()) <= max(drawn.values()) < 100  # 60 expected, six standard deviations


def test_a_sample_of_a_grown_collection_keeps_most_of_its_members() -> None:
    before, after = sampled(families_of({"a": 100}), 50, 1), sampled(families_of({"a": 102}), 50, 1)
    assert len(set(before) - set(after)) <= 2


def test_an_empty_sample_is_refused() -> None:
    with pytest.raises(ProblemError, match="`sample` must be at least 1, got 0"):
        sampled(families_of({"a": 3}), 0, 1)
