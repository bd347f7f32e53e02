"""Solvers in other languages run in child processes, and their faults are classified like those of plugins."""

import pickle
import shutil
from pathlib import Path
from typing import Any, cast

import native_builds
import pytest
from proxbench.bench import load as load_run
from proxbench.bench import resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.isolation.worker import REQUEST_SECONDS
from proxbench.bench.plugins import descriptions, native_files
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.plugins.files import check_plugins_unchanged, plugin_uses, use_plugin_files
from proxbench.bench.plugins.remote_solver import FailedSolveError, RemoteSolver
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems import load
from proxbench.problems.contact.solver import SolverError, Status, Stop
from proxbench.problems.errors import PluginError
from proxbench.solvers.native.executable import START_SECONDS

PROBLEM = "hard-stack-10"


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_builds.faulty_library(tmp_path_factory.mktemp("faulty"))


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_builds.sweeps_in_c(tmp_path_factory.mktemp("sweeps"))


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_builds.faulty_program(tmp_path_factory.mktemp("program"))


def name_of(file: Path, fault: str) -> str:
    kind = "Shared" if file.suffix == ".so" else "Executable"
    return f"{kind}('{file}'{fault and f', options={fault!r}'})"


FAULTS = (
    ("faulty", "crash", Outcome.CRASHED, "SIGSEGV"),
    ("faulty", "exit", Outcome.CRASHED, "exit code 7"),
    ("faulty", "license", Outcome.CRASHED, "exit code 4; the last line of its output is 'license \ufffdexpired'"),
    pytest.param("faulty", "hang", Outcome.TIMEOUT, "longer than", marks=pytest.mark.slow),
    ("faulty", "overrun", Outcome.MISBEHAVED, "wrote beyond the 10 impulses"),
    ("faulty", "short", Outcome.MISBEHAVED, "not finite"),
    ("faulty", "status", Outcome.MISBEHAVED, "returned status 99"),
    ("faulty", "count", Outcome.MISBEHAVED, "number of iterations that is negative"),
    ("program", "exit", Outcome.CRASHED, "ended with exit code 3"),
    ("program", "license", Outcome.CRASHED, "with exit code 1; it wrote 'license \ufffdexpired' to standard error"),
    ("program", "crash", Outcome.CRASHED, "killed by signal 11"),
    pytest.param("program", "hang", Outcome.TIMEOUT, "longer than", marks=pytest.mark.slow),
    ("program", "garbage", Outcome.MISBEHAVED, "does not begin an answer"),
    ("program", "short", Outcome.MISBEHAVED, "impulses of shape (9,)"),
    ("program", "long", Outcome.MISBEHAVED, "impulses of shape (11,)"),
)


@pytest.mark.parametrize(("fixture", "fault", "outcome", "reason"), FAULTS)
def test_a_fault_of_a_native_solver_ends_only_its_own_process(
    fixture: str, fault: str, outcome: Outcome, reason: str, request: pytest.FixtureRequest
) -> None:
    spec = solver_spec(name_of(request.getfixturevalue(fixture), fault))
    with RemoteSolver(spec, seconds=5.0 if fault != "hang" else 1.0) as solver:
        prepared = solver.prepare(load(PROBLEM))
        with pytest.raises(FailedSolveError) as failed:
            prepared.solve(Stop(max_seconds=1.0))
    assert failed.value.outcome is outcome
    assert reason in failed.value.reason
    assert not failed.value.reason.endswith(".")


def test_the_judging_process_does_not_load_the_library(sweeps: Path) -> None:
    spec = solver_spec(f"Shared({sweeps}, options='relaxation=1.5')")
    assert not spec.is_built_in
    assert spec.source == f"shared library {sweeps} (pgs 1.0)"
    assert spec == pickle.loads(pickle.dumps(spec))
    assert str(sweeps) not in Path("/proc/self/maps").read_text()


def test_a_stored_use_names_the_file_its_digest_and_the_version(sweeps: Path) -> None:
    spec = solver_spec(f"Fallback(Shared({sweeps}), NSGS)")
    (use,) = plugin_uses([spec.name, "SORprox"], [])
    assert use == spec.files[0]
    assert (use.name, use.file, len(use.sha256)) == (f"Shared('{sweeps}')", str(sweeps), 64)
    assert "(pgs 1.0)" in use.source


def test_a_library_that_is_built_again_meanwhile_is_refused(sweeps: Path, tmp_path: Path) -> None:
    library = Path(shutil.copy(sweeps, tmp_path / "mine.so"))
    spec = solver_spec(f"Shared({library})")
    with library.open("ab") as file:
        file.write(b"newer")
    with pytest.raises(SolverError, match=r"mine.so has changed since the command began; run the command again"):
        spec.make()


def test_a_stored_run_uses_a_library_only_where_it_is_named(
    sweeps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = Path(shutil.copy(sweeps, tmp_path / "mine.so"))
    uses = solver_spec(f"Shared({library})").files
    check_plugins_unchanged(uses)
    monkeypatch.setattr(native_files, "_allowed", {})
    with pytest.raises(BenchError, match=r"need the file .*mine.so; name it with `plugins`"):
        check_plugins_unchanged(uses)
    use_plugin_files([library])
    check_plugins_unchanged(uses)
    with library.open("ab") as file:
        file.write(b"newer")
    use_plugin_files([library])
    with pytest.raises(BenchError, match=r"file .*mine.so has changed since the run began"):
        check_plugins_unchanged(uses)
    monkeypatch.setattr(native_files, "_allowed", {})
    library.unlink()
    with pytest.raises(BenchError, match=r"mine.so, which is missing; restore it"):
        check_plugins_unchanged(uses)


def test_a_file_that_is_no_solver_library_is_refused_in_one_sentence(
    faulty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["run", "--problem", PROBLEM, "--solver", "Shared(./none.so)"]) == 2
    assert capsys.readouterr().err == (
        "proxbench: there is no shared library ./none.so; build it, or correct its path.\n"
    )
    with pytest.raises(PluginError, match=r"cannot be loaded as a shared library"):
        solver_spec(f"Shared({__file__})")


def test_error_quotes_the_output_of_a_program_that_exits_at_its_start(program: Path) -> None:
    with pytest.raises(PluginError, match="ended with exit code 1; it wrote 'there is no license' to standard error"):
        solver_spec(name_of(program, "unlicensed"))


@pytest.mark.slow
def test_a_library_that_hangs_when_it_is_loaded_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = tmp_path / "hang.c"
    source.write_text(
        "#include <unistd.h>\n__attribute__((constructor)) static void hang(void) { for (;;) pause(); }\n"
    )
    library = native_builds.build_in_c(tmp_path / "libhang.so", source)
    monkeypatch.setitem(cast("Any", descriptions._ask).__kwdefaults__, "seconds", 1.0)
    with pytest.raises(PluginError, match="cannot be created: it does not end within 1 s; correct the code"):
        solver_spec(f"Shared({library})")


def test_the_documented_limits_are_those_in_force() -> None:
    page = (native_builds.EXAMPLES.parent / "how-to" / "solver-in-c.md").read_text(encoding="utf-8")
    assert f"takes longer than {REQUEST_SECONDS:g} s to load (a library)" in page
    assert f"does not answer within {START_SECONDS:g} s of its start (a program)" in page


def test_a_library_solves_where_solves_follow_each_other(sweeps: Path) -> None:
    with RemoteSolver(solver_spec(f"Shared({sweeps})")) as solver:
        shown: list[int] = []
        solution = solver.prepare(load(PROBLEM)).solve(Stop(), observe=lambda iteration, _: shown.append(iteration))
    assert solution.status is Status.SOLVED
    assert shown == list(range(1, solution.iterations + 1))


@pytest.mark.weekly
def test_a_run_measures_libraries_and_programs_and_detects_wrong_claims(
    faulty: Path, sweeps: Path, program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = native_builds.sweeps_as_program(tmp_path)
    names = [f"Shared('{sweeps}')", name_of(faulty, "lie"), name_of(faulty, "hang"), name_of(faulty, "crash")]
    names += [name_of(program, ""), name_of(program, "hang"), f"Executable('{own}')"]
    limits = Limits(solve_seconds=2.0, case_seconds=6.0)
    run([PROBLEM], names, results=str(tmp_path), run_id="it", tolerances=[1e-2], passes=1, limits=limits)
    cases = load_run(tmp_path / "it").cases.set_index("solver")["outcome"].to_dict()
    points = load_run(tmp_path / "it").points.set_index("solver")["outcome"].to_dict()
    assert points[names[0]] == points[names[6]] == "solved"
    assert points[names[1]] == points[names[4]] == "wrong"
    assert [cases[names[number]] for number in (2, 3, 5)] == ["timeout", "crashed", "timeout"]
    monkeypatch.setattr(native_files, "_allowed", {})
    with pytest.raises(BenchError, match="name it with `plugins`"):
        resume(tmp_path / "it")
    resume(tmp_path / "it", plugins=[faulty, sweeps, program, own])
