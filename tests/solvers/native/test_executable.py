"""Executables as solvers: they keep running, end with their solver, and their output is checked."""

import gc
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pytest
from proxbench.bench.measure.contacts.case_process import Measurement
from proxbench.problems import load
from proxbench.problems.contact.solver import SolverError, Status, Stop
from proxbench.solvers import create
from proxbench.solvers.contract import solution_fault
from proxbench.solvers.native.executable import Executable
from proxbench.solvers.native.messages import (
    SOLVE,
    Message,
    read_answer,
    read_description,
    read_iterate,
    read_prepared,
)
from proxbench.solvers.native.native_solver import BrokenInterfaceError


def faulty(program: Path, fault: str = "") -> Executable:
    return Executable(str(program), fault)


def children() -> list[int]:
    return [child.pid for child in psutil.Process().children() if child.status() != psutil.STATUS_ZOMBIE]


def test_one_process_serves_all_solves_and_ends_with_the_solver(program: Path) -> None:
    gc.collect()
    before = children()
    solver = create(f"Executable({program})")
    problems = [load("hard-stack-10"), load("hard-sliding-block")]
    prepared = [solver.prepare(problem) for problem in problems]
    first = [one.solve(Stop()) for one in prepared]
    again = [one.solve(Stop()) for one in prepared]  # each one prepares its problem again
    assert all(np.array_equal(one.impulses, other.impulses) for one, other in zip(first, again, strict=True))
    assert len(children()) == len(before) + 1
    del solver, prepared
    gc.collect()
    assert children() == before


def test_the_message_contains_the_time_by_the_clock_of_the_program(faulty_program: Path) -> None:
    solution = faulty(faulty_program).prepare(load("hard-stack-10")).solve(Stop())
    assert (solution.status, solution.message) == (Status.SOLVED, "0.001 s by its own clock")


def test_a_forked_process_starts_a_program_of_its_own(program: Path) -> None:
    solver, problem = create(f"Executable({program})"), load("hard-stack-10")
    wanted = solver.prepare(problem).solve(Stop()).impulses
    child = os.fork()
    if child == 0:
        is_equal = False
        try:
            is_equal = np.array_equal(solver.prepare(problem).solve(Stop()).impulses, wanted)
        finally:
            os._exit(0 if is_equal else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert np.array_equal(solver.prepare(problem).solve(Stop()).impulses, wanted)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("exit", "ended with exit code 3; answer messages until standard input ends"),
        ("crash", "ended killed by signal 11; answer messages"),
    ],
)
def test_a_program_that_ends_is_an_error_of_the_solve(faulty_program: Path, fault: str, sentence: str) -> None:
    with pytest.raises(SolverError, match=sentence):
        faulty(faulty_program, fault).prepare(load("hard-stack-10")).solve(Stop())


def test_other_text_on_its_standard_output_is_refused(faulty_program: Path) -> None:
    with pytest.raises(
        BrokenInterfaceError, match=r"does not begin an answer; write answers to standard output .* error\.$"
    ):
        faulty(faulty_program, "garbage").prepare(load("hard-stack-10")).solve(Stop())
    with pytest.raises(SolverError, match="sent b'Welcome to my so', which does not begin an answer"):
        faulty(faulty_program, "print")


@pytest.mark.parametrize(
    "read",
    [
        lambda message: read_description("mine", message),
        lambda message: read_prepared("mine", message),
        lambda message: read_answer("mine", message),
        lambda message: read_iterate("mine", message, 3),
    ],
    ids=["description", "prepared", "answer", "iterate"],
)
def test_a_message_that_is_too_short_is_refused_in_a_sentence(read: Callable[[Message], object]) -> None:
    with pytest.raises(BrokenInterfaceError, match=r"^mine sent .*3 bytes.*; send .*[a-z]\.$"):
        read(Message(SOLVE, 0, b"abc"))


@pytest.mark.parametrize(("fault", "shape"), [("short", r"\(9,\)"), ("long", r"\(11,\)")])
def test_impulses_of_the_wrong_length_are_a_fault(faulty_program: Path, fault: str, shape: str) -> None:
    problem = load("hard-stack-10")
    solution = faulty(faulty_program, fault).prepare(problem).solve(Stop())
    assert f"impulses of shape {shape}".replace("\\", "") in str(solution_fault(problem, solution))


def test_a_refusal_to_prepare_ends_as_unsupported(faulty_program: Path) -> None:
    solution = faulty(faulty_program, "refuse").prepare(load("hard-stack-10")).solve(Stop())
    assert (solution.status, solution.message) == (Status.UNSUPPORTED, "no")


def test_files_that_are_no_program_are_refused_with_the_remedy(faulty_program: Path, tmp_path: Path) -> None:
    text = tmp_path / "text"
    text.write_text("no program")
    with pytest.raises(SolverError, match=r"is not executable; run chmod \+x"):
        create(f"Executable({text})")
    text.chmod(0o700)
    with pytest.raises(SolverError, match="cannot be started: Exec format error; build it for this machine"):
        create(f"Executable({text})")
    with pytest.raises(SolverError, match="has version 2 of the interface"):
        faulty(faulty_program, "version")


def test_a_program_that_does_not_answer_after_its_start_is_ended_with_a_sentence(
    faulty_program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxbench.solvers.native.executable.START_SECONDS", 0.1)
    with pytest.raises(SolverError, match=r"has not answered within 0\.1 s of its start; read messages from standard"):
        faulty(faulty_program, "sleep")


def test_the_processor_time_of_the_program_counts_as_that_of_its_case(program: Path) -> None:
    solver = Executable(str(program))
    measurement = Measurement(load("hard-stack-10"), solver)
    before = solver.processor_seconds()
    timed, _ = measurement.round(Stop(1e-8, max_iterations=2000), 0.1)
    spent = solver.processor_seconds() - before
    assert spent > 0.0
    assert sum(timed.processor) >= 0.9 * spent
