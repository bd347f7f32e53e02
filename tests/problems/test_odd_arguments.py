"""Any value as an argument is either accepted or refused by one sentence, and reaches no compiled code unchecked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from proxbench.problems import (
    Answer,
    ContactProblem,
    Laws,
    Model,
    ProblemError,
    ProxbenchError,
    judge,
    load,
    project,
    save_problem,
    suite,
    write_fclib,
)
from proxbench.problems.motion.bodies.rigid.orientation import about
from proxbench.problems.motion.bodies.rigid.shapes import Box
from proxbench.problems.motion.scenes.effects import Drag, Gravity, Spring
from proxbench.problems.motion.scenes.registry import make_scene
from proxbench.problems.motion.scenes.rigid.effects import rigid_bodies
from proxbench.solvers import Stop, create, solve

G = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.1], [0.0, 0.1, 3.0]])
C = np.array([-1.0, 0.5, 0.2])
MATRIX = ContactProblem.from_delassus(G, C, 0.3)
FACTORS = ContactProblem.from_factors(np.eye(3), np.ones(3), C, 0.3)
LAWS: dict[str, Any] = {
    "kind": [0, 2],
    "first_row": [0, 1],
    "friction_coefficient": [0, 0.3],
    "fixed_bound": [0, 0],
    "partner": [-1, 0],
}

ODD: dict[str, Any] = {
    "None": None,
    "text": "abc",
    "bytes": b"x",
    "nan": float("nan"),
    "infinity": np.inf,
    "negative": -1,
    "huge": 1e300,
    "huge integer": 10**400,
    "complex": 1j,
    "boolean": True,
    "list": [],
    "ragged list": [[1], [2, 3]],
    "mapping": {},
    "object": object(),
    "function": len,
    "class": int,
    "empty array": np.zeros((0, 0)),
    "long array": np.zeros(5),
    "cube": np.zeros((2, 2, 2)),
    "texts": np.array(["a", "b", "c"]),
    "objects": np.array([None, 1, 2], dtype=object),
    "times": np.array([1, 2, 3], dtype="m8[s]"),
    "records": np.zeros(3, dtype=[("a", float)]),
    "nan array": np.full(3, np.nan),
    "sparse": sp.csr_array((3, 3)),
}

CALLS: dict[str, Callable[[Any], object]] = {
    "G": lambda odd: ContactProblem.from_delassus(odd, C, 0.3),
    "c": lambda odd: ContactProblem.from_delassus(G, odd, 0.3),
    "friction": lambda odd: ContactProblem.from_delassus(G, C, odd),
    "dim": lambda odd: ContactProblem.from_delassus(G, C, 0.3, odd),
    "laws": lambda odd: ContactProblem.from_delassus(G, C, laws=odd),
    "W": lambda odd: ContactProblem.from_factors(odd, np.ones(3), C, 0.3),
    "M⁻¹": lambda odd: ContactProblem.from_factors(np.eye(3), odd, C, 0.3),
    "free motion": lambda odd: ContactProblem.from_factors(np.eye(3), np.ones(3), C, 0.3, free_motion=odd),
    "factors": lambda odd: ContactProblem(C, MATRIX.laws, factors=odd),
    "with_free_velocity": MATRIX.with_free_velocity,
    "renamed": MATRIX.renamed,
    "answered": MATRIX.answered,
    "keyed": MATRIX.keyed,
    "relative_velocity of G": MATRIX.relative_velocity,
    "relative_velocity of factors": FACTORS.relative_velocity,
    "accurate_velocity of G": MATRIX.accurate_velocity,
    "accurate_velocity of factors": FACTORS.accurate_velocity,
    "laws.contacts, friction": lambda odd: Laws.contacts(odd, 3, 1),
    "laws.contacts, dim": lambda odd: Laws.contacts(0.3, odd, 1),
    "laws.contacts, n_contacts": lambda odd: Laws.contacts(0.3, 3, odd),
    "laws.joints": Laws.joints,
    "laws.concatenate": Laws.concatenate,
    "laws.concatenate, member": lambda odd: Laws.concatenate([odd]),
    "laws.with_rolling, friction": lambda odd: Laws.contacts(0.3, 3, 1).with_rolling(odd, 1),
    "laws.with_rolling, n_rows": lambda odd: Laws.contacts(0.3, 3, 1).with_rolling(0.1, odd),
    "project, laws": lambda odd: project(odd, np.zeros(3)),
    "project, impulses": lambda odd: project(MATRIX.laws, odd),
    "judge, problem": lambda odd: judge(odd, np.zeros(3)),
    "judge, impulses": lambda odd: judge(MATRIX, odd),
    "judge, model": lambda odd: judge(MATRIX, np.zeros(3), odd),
    "model": Model.pyramid,
    "load": load,
    "suite": suite,
    "save_problem": lambda odd: save_problem(odd, "odd.npz"),
    "write_fclib": lambda odd: write_fclib(odd, "odd.hdf5"),
    "acceleration": Gravity,
    "drag": Drag,
    "stiffness": lambda odd: Spring(odd, (0.0, 0.0, 0.0)),
    "anchor": lambda odd: Spring(1.0, odd),
    "axis": lambda odd: about(odd, 1.0),
    "angle": lambda odd: about((1.0, 0.0, 0.0), odd),
    "masses": lambda odd: rigid_bodies([Box((1.0, 1.0, 1.0))], odd, [], [Gravity()]),
    "options of a scene": lambda odd: make_scene("pile", odd),
    "create": create,
    "solve, problem": solve,
    "solve, solver": lambda odd: solve(MATRIX, odd),
    "solve, tolerance": lambda odd: solve(MATRIX, "SORprox", odd),
    "solve, max_iterations": lambda odd: solve(MATRIX, "SORprox", max_iterations=odd),
    "solve, max_seconds": lambda odd: solve(MATRIX, "SORprox", max_seconds=odd),
    "start": lambda odd: create("SORprox").prepare(MATRIX).solve(Stop(1e-6), odd),
    "stop": lambda odd: create("SORprox").prepare(MATRIX).solve(odd),
    "relaxation": lambda odd: create("SORprox", relaxation=odd),
    "form": lambda odd: create("SORprox", form=odd),
    "momentum": lambda odd: create("SORprox", momentum=odd),
    "sides": lambda odd: create("PyramidPGS", sides=odd),
    "memory": lambda odd: create("AndersonSORprox", memory=odd),
    "threads": lambda odd: create("ColouredSORprox", threads=odd),
    "solver of cvxpy": lambda odd: create("CvxpyCoulomb", solver=odd),
}
for field in ("name", "provenance", "answer", "keys", "engine", "allow_asymmetric"):
    CALLS[field] = lambda odd, field=field: ContactProblem.from_delassus(G, C, 0.3, **{field: odd})  # type: ignore[misc]
for field in ("impulses", "velocity", "functionals", "values", "witness", "sensitivity"):
    CALLS[f"answer.{field}"] = lambda odd, field=field: MATRIX.answered(Answer(**{field: odd}))  # type: ignore[misc]
for field in LAWS:
    CALLS[f"laws.{field}"] = lambda odd, field=field: Laws(**{**LAWS, field: odd})  # type: ignore[misc]


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_value_is_accepted_or_refused_by_one_sentence(
    call: Callable[[Any], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for odd in ODD.values():
        refusals = []
        try:
            call(odd)
        except ProxbenchError as refusal:
            refusals.append(str(refusal))
        assert not [text for text in refusals if "\n" in text or not text.endswith((".", "?"))]


@pytest.mark.parametrize("problem", [MATRIX, FACTORS], ids=["G", "factors"])
@pytest.mark.parametrize("length", [0, 2, 4, 1000])
def test_impulses_of_another_length_are_not_multiplied(problem: ContactProblem, length: int) -> None:
    """Compiled code would read beyond their end."""
    for product in (problem.relative_velocity, problem.accurate_velocity):
        with pytest.raises(ProblemError, match=rf"impulses must have shape \(3,\).*got \({length},\)"):
            product(np.ones(length))


def test_a_rotation_about_no_axis_is_refused_and_not_a_number() -> None:
    with pytest.raises(ProblemError, match="axis of a rotation must not be zero"):
        about((0.0, 0.0, 0.0), 1.0)


def test_a_solution_that_is_not_in_a_list_is_refused_with_the_remedy() -> None:
    with pytest.raises(ProblemError, match=r"for one solution, pass \[impulses\]"):
        Answer(impulses=np.ones(3))  # type: ignore[arg-type]
