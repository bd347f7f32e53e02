"""A problem survives JSON bit by bit, and invalid input is refused in one sentence."""

import json
from pathlib import Path

import numpy as np
import pytest
from proxbench.problems import ContactProblem, ProblemError, load, save_problem


@pytest.mark.parametrize("name", ["hard-sticking-box", "funnel-30", "hard-tresca-joint", "woodpecker-beak-impact"])
def test_a_problem_survives_json_bit_by_bit(name: str, tmp_path: Path) -> None:
    problem = load(name)
    save_problem(problem, tmp_path / "p.json")
    again = load(tmp_path / "p.json")
    assert (again.digest, again.name, dict(again.provenance)) == (problem.digest, name, dict(problem.provenance))
    assert (again.answer is None) == (problem.answer is None)
    if problem.answer is not None and problem.answer.witness is not None:
        assert np.array_equal(again.answer.witness, problem.answer.witness)  # type: ignore[union-attr, arg-type]


def test_plain_lists_are_a_problem(tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_text('{"G": [[2, 0, 0], [0, 1, 0], [0, 0, 1]], "c": [-1, 0, 0], "mu": 0.5}')
    problem = load(tmp_path / "mine.json")
    assert problem.digest == ContactProblem.from_delassus(np.diag([2.0, 1.0, 1.0]), [-1.0, 0.0, 0.0], 0.5).digest
    assert problem.name == "mine"


def test_factors_in_plain_lists_are_a_problem(tmp_path: Path) -> None:
    W, mass = np.eye(6)[:, [2, 0, 1]], np.array([2.0, 2.0, 2.0, 0.5, 0.5, 0.5])
    for name, value in (("M", mass), ("Minv", 1.0 / mass), ("M", np.stack([np.diag(mass[:3]), np.diag(mass[3:])]))):
        document = {"W": W.tolist(), name: value.tolist(), "c": [-1.0, 0.0, 0.0], "mu": [0.5]}
        (tmp_path / "mine.json").write_text(json.dumps(document))
        expected = ContactProblem.from_factors(W, 1.0 / mass, [-1.0, 0.0, 0.0], [0.5])
        assert load(tmp_path / "mine.json").digest == expected.digest


def test_a_changed_number_is_noticed(tmp_path: Path) -> None:
    save_problem(load("hard-sticking-box"), tmp_path / "p.json")
    document = json.loads((tmp_path / "p.json").read_text())
    document["c"][0] += 1e-3
    (tmp_path / "p.json").write_text(json.dumps(document))
    with pytest.raises(ProblemError, match="does not match its digest"):
        load(tmp_path / "p.json")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "it is not a JSON document"),
        ("[1, 2]", "it is not a JSON object of named arrays"),
        ('{"about": 3}', "'about' is not an object"),
        ('{"G": [[1, 2], [3]], "c": [0], "mu": 0.5}', "'G' is not an array of numbers"),
        ('{"G": {"a": 1}, "c": [0], "mu": 0.5}', "'G' is not an array of numbers"),
        ('{"G": [[1]], "c": [NaN], "dim": 1}', "must be finite"),
        ("[" * 100_000, "it is not a JSON document"),
        ('{"nothing": 1}', "not a problem file"),
    ],
)
def test_invalid_json_problems_are_refused_with_the_path(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "p.json").write_text(text)
    with pytest.raises(ProblemError, match=words) as caught:
        load(tmp_path / "p.json")
    assert str(caught.value).startswith(str(tmp_path / "p.json"))


def test_unknown_file_name_extensions_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"end in .npz or .json, and .* does not; name it p.npz"):
        save_problem(load("hard-sticking-box"), tmp_path / "p.txt")
