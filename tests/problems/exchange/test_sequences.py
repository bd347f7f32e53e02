"""Steps of a sequence know the previous step, and a warm start continues its impulses contact by contact."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, load
from proxbench.problems.contact.solver import Stop
from proxbench.problems.exchange.catalog import SEQUENCE_MEMBERS
from proxbench.problems.exchange.files.problem_file import save_problem
from proxbench.problems.exchange.sequences import BEFORE, STEP, predecessors, start_digest, warm_start_impulses
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.stepping.midpoint import MidpointRule
from proxbench.solvers import create


def contacts(*keys: str, dim: int = 3) -> ContactProblem:
    n_rows = dim * len(keys)
    return ContactProblem.from_delassus(np.eye(n_rows), -np.ones(n_rows), 0.3, dim).keyed(keys)


def test_a_contact_keeps_its_impulses_wherever_it_stands_and_a_new_one_has_none() -> None:
    before, after = contacts("a", "b", "c"), contacts("c", "new", "a")
    start = warm_start_impulses(before, np.arange(1.0, 10.0), after)
    assert start.tolist() == [7.0, 8.0, 9.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


def test_a_contact_with_other_rows_and_a_problem_without_keys_start_from_zero() -> None:
    before = contacts("a", dim=1)
    assert not warm_start_impulses(before, np.ones(1), contacts("a")).any()
    assert not warm_start_impulses(replace(before, keys=()), np.ones(1), contacts("a", dim=1)).any()


def test_the_digest_of_a_start_covers_the_numbers_of_earlier_steps_and_the_rows_that_continue() -> None:
    first, second, problem = contacts("a", "b"), contacts("b", "c"), contacts("c", "b", "d")
    digest = start_digest([first, second], problem)
    assert start_digest([], problem) == ""
    same = [
        ([first.fresh(), second.renamed("other")], problem.fresh()),
        ([first.keyed(["A", "B"]), second.keyed(["B", "C"])], problem.keyed(["C", "B", "D"])),
        ([first, second], problem.keyed(["c", "b", "e"])),
    ]
    assert {start_digest(*start) for start in same} == {digest}
    stiffer = replace(first, free_velocity=2.0 * first.free_velocity)
    other = [
        ([second], problem),
        ([stiffer, second], problem),
        ([first.keyed(["b", "a"]), second], problem),
        ([first, second], problem.keyed(["b", "c", "d"])),
        ([first, second], problem.keyed(["e", "b", "d"])),
    ]
    assert len({digest, *(start_digest(*start) for start in other)}) == len(other) + 1


class Recorder:
    """A solver that stores the given start."""

    def __init__(self) -> None:
        self.starts: list[np.ndarray | None] = []

    def prepare(self, problem: ContactProblem) -> "Recorder":
        self.prepared = create("SORprox").prepare(problem)
        return self

    def solve(self, stop: Stop, start: np.ndarray | None = None, observe: object = None) -> object:
        self.starts.append(start)
        return self.prepared.solve(stop, start)


def test_a_warm_start_equals_that_of_a_stepper() -> None:
    scene, solver = make_scene("stack"), Recorder()
    stepper = MidpointRule(scene.system, solver, Stop(1e-6), scene.step_size)
    first, second = stepper.steps(scene.start, 2)
    problems = [
        step.problem.keyed([str(key) for key in step.contacts.keys])
        for step in (first, second)
        if step.problem is not None and step.contacts is not None
    ]
    start = warm_start_impulses(problems[0], first.impulses, problems[1])
    np.testing.assert_array_equal(start, solver.starts[-1])
    assert start.any()


def test_keys_name_each_contact_once_and_are_no_numbers_of_the_problem() -> None:
    problem = contacts("a", "b")
    assert problem.digest == replace(problem, keys=()).digest
    assert problem.anonymous().keys == ()
    with pytest.raises(ProblemError, match="must name each of 2 contacts, got 1"):
        problem.keyed(["a"])
    with pytest.raises(ProblemError, match="'a' more than once"):
        problem.keyed(["a", "a"])


@pytest.mark.parametrize("ending", ["npz", "json"])
def test_keys_survive_a_file(tmp_path: object, ending: str) -> None:
    file = f"{tmp_path}/steps.{ending}"
    save_problem(contacts("ground | box #2", "é"), file)
    assert load(file).keys == ("ground | box #2", "é")


def test_predecessors_are_the_consecutive_steps_from_the_first_on() -> None:
    steps = [contacts("a").renamed(f"s-{number}", **{STEP: number}) for number in range(3)]
    steps[1:] = [step.renamed(step.name, **{BEFORE: f"s-{number}"}) for number, step in enumerate(steps[1:])]
    known = {step.name: step for step in steps}
    assert [step.name for step in predecessors(steps[2], known.get).steps] == ["s-0", "s-1"]
    assert predecessors(steps[0], known.get).steps == ()
    assert "s-1, which is not available" in predecessors(steps[2], {}.get).missing
    known["s-1"] = steps[1].renamed("s-1", **{STEP: 0})
    assert "not consecutive" in predecessors(steps[2], known.get).missing


@pytest.mark.parametrize("name", ["flow-30", "stack-10", "chain-20", "pile-100"])
def test_the_steps_of_a_shipped_sequence_follow_each_other_and_share_most_contacts(name: str) -> None:
    steps = [load(member) for member in SEQUENCE_MEMBERS[name]]
    assert [step.name for step in predecessors(steps[-1], load).steps] == SEQUENCE_MEMBERS[name][:-1]
    for before, after in pairwise(steps):
        assert len(set(before.keys) & set(after.keys)) > 0.8 * after.n_contacts
        assert warm_start_impulses(before, np.ones(before.n_rows), after).mean() > 0.8
