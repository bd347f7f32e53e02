"""A fault of a solver affects only its own case, and is recorded by its kind."""

import subprocess
import sys
import time
from collections.abc import Iterator

import psutil
import pytest
from counting_task import Counting
from misbehaving_solvers import Misbehaving
from msgspec.structs import replace
from proxbench.bench.isolation import fork_server
from proxbench.bench.isolation.child import FORK_REQUEST, MAX_FILE_BYTES
from proxbench.bench.isolation.process_tree import running
from proxbench.bench.isolation.worker import Fault, Worker
from proxbench.bench.measure.contacts.case import Case
from proxbench.bench.measure.ladder import CasePass
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.store.outcome import Outcome
from proxbench.bench.store.plans import Limits
from proxbench.problems import load
from proxbench.problems.contact.solver import Stop
from proxbench.problems.exchange.files.problem_file import problem_bytes
from proxbench.solvers import create

LIMITS = Limits(solve_seconds=30.0, memory_bytes=2**28)
ENDLESS = {"sleep": 1.0, "spin": 1.0, "allocate for ever": 5.0}
"""Time limits of actions that never end by themselves [s]; others have enough time even on a busy machine."""


def carried_out(action: str) -> Case:
    problem = load("hard-sticking-box")
    limits = replace(LIMITS, case_seconds=ENDLESS.get(action, LIMITS.case_seconds))
    case = Case(
        problem,
        solver_spec(Misbehaving(action)),
        limits,
        [1e-6],
        problem_data=problem_bytes(problem),
        stored=None,
        case_pass=CasePass(),
    )
    try:
        case.begin()
        if case.is_open(0):
            answer = case.measure(1e-6, 0)
            if answer is not None:
                case.add_point(0, [answer])
    finally:
        case.end()
    return case


@pytest.mark.parametrize(
    ("action", "outcome", "words"),
    [
        ("raise", Outcome.CRASHED, "the plugin gave up"),
        ("exit", Outcome.CRASHED, "exit code 7"),
        ("segfault", Outcome.CRASHED, "SIGSEGV"),
        pytest.param("sleep", Outcome.TIMEOUT, "its 1 s", marks=pytest.mark.slow),
        pytest.param("spin", Outcome.TIMEOUT, "its 1 s", marks=pytest.mark.slow),
        pytest.param("allocate", Outcome.OUT_OF_MEMORY, "256 MiB", marks=pytest.mark.slow),
        pytest.param(
            "allocate for ever",
            Outcome.OUT_OF_MEMORY,
            "it used all its 256 MiB of memory and did not end in time",
            marks=pytest.mark.slow,
        ),
        ("allocate in c", Outcome.OUT_OF_MEMORY, "when its 256 MiB of memory were full"),
        ("fail to factorise", Outcome.OUT_OF_MEMORY, "no room for the factor when it requested more than 256 MiB"),
        ("die", Outcome.CRASHED, "killed by SIGKILL"),
        ("none", Outcome.MISBEHAVED, "NoneType"),
        ("shape", Outcome.MISBEHAVED, "shape (1,)"),
        ("nan", Outcome.MISBEHAVED, "not finite"),
        ("write", Outcome.MISBEHAVED, "changed the numbers"),
    ],
)
def test_record_names_the_fault_and_no_process_remains(action: str, outcome: Outcome, words: str) -> None:
    case = carried_out(action)
    record = case.record()
    assert record.outcome is outcome
    assert words in record.reason
    _, still_alive = psutil.wait_procs(processes_of_cases(), timeout=60.0)
    assert still_alive == []


def processes_of_cases() -> list[psutil.Process]:
    """Return the processes that the server of this process has forked and that still run."""
    return [process for server in psutil.Process().children() for process in server.children(recursive=True)]


def test_a_fault_keeps_traceback_and_output() -> None:
    record = carried_out("print").record()
    assert "RuntimeError: after much noise" in record.traceback
    assert "noise noise" in record.stderr
    assert len(record.stderr) <= 4000


def test_the_record_of_a_solver_killed_by_a_signal_shows_where_it_crashed() -> None:
    printed = carried_out("segfault").record().stderr
    assert "in do_segfault" in printed
    assert "Extension modules" not in printed


def test_replacing_framework_functions_is_misbehaviour() -> None:
    record = carried_out("patch").record()
    assert (record.outcome, record.points) == (Outcome.MISBEHAVED, [])
    assert "it replaced " in record.reason


def test_a_false_claim_is_wrong() -> None:
    points = carried_out("lie").record().points
    assert [point.outcome for point in points] == [Outcome.WRONG]
    assert points[0].measured is not None
    assert points[0].measured.residual is not None
    assert points[0].measured.residual > 1e-3


@pytest.fixture
def worker() -> Iterator[Worker]:
    made = Worker(Counting(), 60.0, 2**28)
    yield made
    made.close()


def test_forked_copies_do_not_change_their_parent(worker: Worker) -> None:
    counts = [
        worker.ask("count"),
        worker.ask(FORK_REQUEST, "count", ()),
        worker.ask(FORK_REQUEST, "count", ()),
        worker.ask("count"),
    ]
    assert [answer["count"] for answer, _ in counts] == [1, 2, 2, 2]


def test_end_of_a_forked_copy_is_reported_and_the_case_continues(worker: Worker) -> None:
    with pytest.raises(Fault, match="exit code 9"):
        worker.ask(FORK_REQUEST, "die", ())
    assert worker.ask("count")[0]["count"] == 1


def test_processes_that_a_case_leaves_are_counted(worker: Worker) -> None:
    worker.ask("count")
    assert worker.n_started() == 0
    worker.ask("leave a process")
    assert worker.n_started() == 1


def test_case_and_its_children_are_stopped_between_requests(worker: Worker) -> None:
    worker.ask("leave a process")
    processes = [psutil.Process(worker.process), *psutil.Process(worker.process).children(recursive=True)]
    assert len(processes) == 2
    deadline = time.monotonic() + 30.0
    while any(process.status() != psutil.STATUS_STOPPED for process in processes) and time.monotonic() < deadline:
        time.sleep(1e-3)
    assert [process.status() for process in processes] == [psutil.STATUS_STOPPED] * 2
    worker.ask("end what is left")  # possible only if the process continues
    assert worker.n_started() == 0


def test_a_process_that_a_solver_forks_gives_no_answer(worker: Worker) -> None:
    """The fork returns from the task as its parent does, but one request has one answer."""
    assert worker.ask("fork and return in both")[0]["fork has ended"]
    assert [worker.ask("count")[0]["count"] for _ in range(3)] == [1, 2, 3]


def test_the_processor_time_of_a_process_is_known_while_it_lives(worker: Worker) -> None:
    before = worker.processor_seconds()
    worker.ask("work")
    assert worker.processor_seconds() >= before + 0.02
    with pytest.raises(Fault):
        worker.ask("die")
    assert (worker.process, worker.processor_seconds()) == (0, 0.0)


def test_a_process_may_leave_no_core_file_and_no_large_one(worker: Worker) -> None:
    limits = worker.ask("limits")[0]
    assert limits["core"] == [0, 0]
    assert limits["file"][0] == limits["file"][1] <= MAX_FILE_BYTES


def test_all_requests_of_a_process_share_its_limit_of_time(worker: Worker) -> None:
    worker.ask("count")
    worker.busy_seconds += 100.0
    worker.case_seconds = worker.busy_seconds + 0.2
    worker.ask("count")
    with pytest.raises(Fault, match="the case took longer than its") as found:
        worker.ask("sleep")
    assert found.value.outcome is Outcome.TIMEOUT


@pytest.fixture
def new_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A fork server that only this test uses."""
    monkeypatch.setattr(fork_server, "_server", None)
    yield
    if fork_server._server is not None:
        fork_server._server.end()


def _kernels_to_load() -> int:
    """Return the number of cached kernels that a new process of a case has to load."""
    worker = Worker(Counting(), 60.0, 2**28)
    try:
        return int(worker.ask("load kernels")[0]["kernels"])
    finally:
        worker.close()


@pytest.mark.weekly
def test_processes_of_cases_load_no_cached_kernel_after_the_server_has_loaded_all(new_server: None) -> None:
    create("SORprox").prepare(load("bodies-table-4-1e4").fresh()).solve(
        Stop(1e-6)
    )  # stores other kernels than the server has
    assert _kernels_to_load() > 0
    fork_server.load_kernels()
    assert _kernels_to_load() == 0


@pytest.mark.slow
def test_fork_server_ends_with_the_process_that_started_it() -> None:
    start = "fork_server._server = fork_server._ServerClient(); print(fork_server._server._process.pid)"
    program = f"from proxbench.bench.isolation import fork_server; {start}"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        server = int(process.stdout.readline())
        assert process.wait() == 0
        assert not running([server])


def test_no_server_is_started_to_load_kernels(new_server: None) -> None:
    fork_server.load_kernels()
    assert fork_server._server is None


@pytest.mark.slow
def test_the_server_loads_the_solvers_that_cases_name_and_no_others(new_server: None) -> None:
    assert _loaded_solvers(()) == set()
    assert "PyramidPGS" in _loaded_solvers(("PyramidPGS",))
    assert "Lemke" not in _loaded_solvers(())
    assert {"PyramidPGS", "Lemke"} <= _loaded_solvers(("Lemke",))


def _loaded_solvers(solvers: tuple[str, ...]) -> set[str]:
    """Return the built-in solvers that a new process has imported if its case names ``solvers``."""
    worker = Worker(Counting(), 60.0, 2**28, solvers)
    try:
        return set(worker.ask("solvers")[0]["loaded"])
    finally:
        worker.close()
