"""Shared libraries as solvers: their arguments, the interpretation of their answers, and refused libraries."""

import pickle
import platform
import sys
from pathlib import Path

import numpy as np
import pytest
from native_builds import FOLDER, build_in_c
from proxbench.problems import ContactProblem, load
from proxbench.problems.arrays import FloatArray
from proxbench.problems.contact.solver import SolverError, Status, Stop
from proxbench.problems.errors import ProblemError
from proxbench.solvers import create
from proxbench.solvers.contract import solution_fault
from proxbench.solvers.native.elf import elf_length, own_processor
from proxbench.solvers.native.native_solver import BrokenInterfaceError
from proxbench.solvers.native.shared_library import Shared


def ten_contacts() -> ContactProblem:
    rng = np.random.default_rng(3)
    return ContactProblem.from_factors(rng.normal(size=(40, 30)), np.ones(40), rng.normal(size=30), 0.3)


def faulty(library: Path, fault: str = "") -> Shared:
    return Shared(str(library), fault)


def test_a_path_without_quotes_is_accepted_and_the_name_recreates_the_solver(faulty_library: Path) -> None:
    solver = create(f"Shared({faulty_library}, options='lie')")
    assert solver == create(solver.name) == pickle.loads(pickle.dumps(solver))
    assert solver.name == f"Shared('{faulty_library}', options='lie')"


def test_a_part_of_another_solver_may_be_a_library(c_library: Path) -> None:
    solver = create(f"Fallback(Shared({c_library}), NSGS)")
    assert solver.prepare(load("hard-stack-10")).solve(Stop()).status is Status.SOLVED


def test_a_description_is_read(faulty_library: Path, c_library: Path) -> None:
    solver = faulty(faulty_library)
    assert solver.source == f"shared library {faulty_library} (faulty 0.1)"
    assert (str(solver.model), solver.has_iterates, solver.is_randomised) == ("coulomb", True, False)
    assert Shared(str(c_library)).facts.name == "pgs"


@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("hard-four-bar-redundant", "joints"),
        ("hard-resisting-sphere-steep", "rolling friction"),
        ("hard-tresca-joint", "friction bounds other than"),
    ],
)
def test_laws_that_it_does_not_declare_are_refused(faulty_library: Path, name: str, law: str) -> None:
    reason = faulty(faulty_library).supports(load(name))
    assert reason is not None
    assert law in reason
    with pytest.raises(SolverError, match="cannot solve"):
        faulty(faulty_library).prepare(load(name))


@pytest.mark.parametrize("fault", ["overrun", "underrun"])
def test_a_write_outside_the_impulses_is_detected(faulty_library: Path, fault: str) -> None:
    prepared = faulty(faulty_library, fault).prepare(ten_contacts())
    with pytest.raises(BrokenInterfaceError, match="wrote beyond the 30 impulses"):
        prepared.solve(Stop())


def test_an_answer_with_a_missing_row_is_not_finite(faulty_library: Path) -> None:
    problem = ten_contacts()
    solution = faulty(faulty_library, "short").prepare(problem).solve(Stop())
    assert "not finite" in str(solution_fault(problem, solution))


def test_an_unknown_status_number_is_refused(faulty_library: Path) -> None:
    with pytest.raises(BrokenInterfaceError, match="returned status 99"):
        faulty(faulty_library, "status").prepare(ten_contacts()).solve(Stop())


def test_a_refusal_to_prepare_ends_as_unsupported(faulty_library: Path) -> None:
    solution = faulty(faulty_library, "refuse").prepare(ten_contacts()).solve(Stop())
    assert (solution.status, solution.message) == (Status.UNSUPPORTED, "it is not in the mood")


def test_a_message_comes_with_its_status_in_one_line_without_control_characters(faulty_library: Path) -> None:
    solution = faulty(faulty_library, "limit").prepare(ten_contacts()).solve(Stop())
    assert (solution.status, solution.message) == (Status.ITERATION_LIMIT, "the limit \ufffd[31mwas small")


def test_what_it_writes_to_its_arrays_does_not_reach_the_problem(faulty_library: Path) -> None:
    problem = ten_contacts()
    digest = problem.digest
    faulty(faulty_library, "write").prepare(problem).solve(Stop())
    assert problem.fresh().digest == digest


def test_the_start_is_passed_on_and_checked(faulty_library: Path) -> None:
    prepared, start = faulty(faulty_library).prepare(ten_contacts()), np.arange(30.0)
    assert np.array_equal(prepared.solve(Stop(), start=start).impulses, start)
    assert not prepared.solve(Stop()).impulses.any()
    with pytest.raises(ProblemError, match=r"start must have shape \(30,\)"):
        prepared.solve(Stop(), start=np.zeros(3))


def test_the_threads_of_the_environment_are_granted(faulty_library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert faulty(faulty_library).prepare(ten_contacts()).solve(Stop()).iterations == 3


def test_iterates_are_shown_read_only_and_an_error_of_the_observer_is_raised(faulty_library: Path) -> None:
    shown: list[int] = []

    def observe(iteration: int, impulses: FloatArray) -> None:
        assert not impulses.flags.writeable
        shown.append(iteration)
        if iteration == 2:
            raise KeyError("enough")

    prepared = faulty(faulty_library, "observe").prepare(ten_contacts())
    with pytest.raises(KeyError, match="enough"):
        prepared.solve(Stop(), observe=observe)
    assert shown == [1, 2]


def test_files_that_are_no_solver_are_refused_with_the_remedy(tmp_path: Path) -> None:
    def variant(name: str, option: str) -> Path:
        return build_in_c(tmp_path / name, FOLDER / "faulty.c", options=(option,))

    (tmp_path / "text.so").write_text("no library")
    bad = {
        tmp_path / "none.so": "there is no shared library .*; build it, or correct its path",
        tmp_path / "text.so": "cannot be loaded as a shared library .*; build it with cc -shared -fPIC",
        variant("lacking.so", "-DWITHOUT_FREE"): "has no function proxbench_free; include proxbench.h",
        variant("newer.so", "-DVERSION=2"): "has version 2 of the interface, .* needs version 1; build it again",
        variant("modern.so", "-DMODEL=9"): "describes model 9; return one of pb_model",
    }
    for file, sentence in bad.items():
        with pytest.raises(SolverError, match=sentence):
            create(f"Shared({file})")
    for text in ("Shared", "Shared(path=1)"):
        with pytest.raises(SolverError, match="needs the path of a file"):
            create(text)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the headers of ELF files")
@pytest.mark.parametrize("share", [0.001, 0.01, 0.3, 0.6, 0.8])
def test_a_library_that_is_cut_off_is_refused_before_it_is_loaded(
    share: float, faulty_library: Path, tmp_path: Path
) -> None:
    content = faulty_library.read_bytes()
    assert elf_length(faulty_library) <= len(content)
    cut = tmp_path / "cut.so"
    cut.write_bytes(content[: int(share * elf_length(faulty_library))])
    sentence = f"is truncated after {cut.stat().st_size} bytes; build or copy it again"
    with pytest.raises(SolverError, match=sentence):
        create(f"Shared({cut})")


@pytest.mark.parametrize(
    ("number", "processor"),
    [(8, "MIPS"), (22, "s390"), (4242, "the processor with ELF machine number 4242")],
)
def test_a_library_for_another_processor_is_refused_with_both_processors(
    faulty_library: Path, tmp_path: Path, number: int, processor: str
) -> None:
    own = own_processor()
    if not own:
        pytest.skip("the system has no ELF files")
    content = bytearray(faulty_library.read_bytes())
    content[18:20] = number.to_bytes(2, sys.byteorder)
    foreign = tmp_path / "foreign.so"
    foreign.write_bytes(content)
    with pytest.raises(SolverError) as refused:
        create(f"Shared({foreign})")
    assert str(refused.value) == (
        f"shared library {foreign} is built for {processor}, but this process runs on {own}; build it for {own}."
    )


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows the file of a process")
def test_the_processor_of_this_process_is_that_of_the_machine() -> None:
    names = {"x86_64": "x86-64", "aarch64": "AArch64"}
    assert own_processor() == names.get(platform.machine(), own_processor())
