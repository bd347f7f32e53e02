"""Solvers that each break one rule, for tests in a child process."""

import atexit
import contextlib
import ctypes
import gc
import hashlib
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from proxbench.problems import ContactProblem, load
from proxbench.solvers import Model, Solution, Status, Stop, create


@dataclass(frozen=True)
class Misbehaving:
    """SORprox with the fault named ``action``; with ``only``, it supports only that problem."""

    action: str
    only: str = ""

    model: ClassVar[Model] = Model.COULOMB
    has_iterates: ClassVar[bool] = False

    @property
    def name(self) -> str:
        return f"Misbehaving({self.action})"

    def supports(self, problem: ContactProblem) -> str | None:
        if self.only and problem.n_rows != load(self.only).n_rows:
            return f"it misbehaves on {self.only} alone"
        if self.action == "refuse badly":
            raise RuntimeError("for no reason")
        return {"refuse at length": "never " * 10**6, "refuse without words": " "}.get(self.action)

    def prepare(self, problem: ContactProblem) -> "_Prepared":
        if self.action == "prepare for ever":
            time.sleep(1000)
        return _Prepared(problem, self.action)


_ONCE = {
    "print gigabytes",
    "start threads",
    "start processes",
    "run away",
    "return twice",
    "move",
    "litter",
    "leave slowly",
}
"""Actions with a lasting effect, which need not be repeated in every solve."""

_kept: list[object] = []
"""Objects that are kept until the process ends."""

_done: set[str] = set()
"""Actions that this process has already taken."""


class SlowToGo:
    def __del__(self) -> None:
        time.sleep(1000)


class NoOrdinaryError(BaseException):
    pass


class UnprintableError(Exception):
    def __str__(self) -> str:
        raise ValueError("it cannot be printed")


@dataclass
class _Prepared:
    problem: ContactProblem
    action: str

    def solve(self, stop: Stop, start: object = None, observe: object = None) -> object:
        solution = create("SORprox").prepare(self.problem).solve(stop)
        if self.action in _ONCE and self.action in _done:
            return solution
        _done.add(self.action)
        return getattr(self, f"do_{self.action.replace(' ', '_')}")(solution)

    # wrong return values

    def do_raise(self, solution: Solution) -> object:
        raise RuntimeError("the plugin gave up")

    def do_raise_badly(self, solution: Solution) -> object:
        raise UnprintableError

    def do_raise_anything(self, solution: Solution) -> object:
        raise NoOrdinaryError("beyond every except clause")

    def do_interrupt(self, solution: Solution) -> object:
        raise KeyboardInterrupt

    def do_leave(self, solution: Solution) -> object:
        sys.exit("enough")

    def do_recur(self, solution: Solution) -> object:
        return self.do_recur(solution)

    def do_none(self, solution: Solution) -> object:
        return None

    def do_shape(self, solution: Solution) -> object:
        return Solution(np.zeros(1), Status.SOLVED, 1)

    def do_type(self, solution: Solution) -> object:
        return Solution(np.array(["impulse"] * self.problem.n_rows), Status.SOLVED, 1)  # type: ignore[arg-type]

    def do_status(self, solution: Solution) -> object:
        return Solution(solution.impulses, "perfect", 1)  # type: ignore[arg-type]

    def do_nan(self, solution: Solution) -> object:
        return Solution(np.full(self.problem.n_rows, np.nan), Status.SOLVED, 1)

    def do_lie(self, solution: Solution) -> object:
        return Solution(np.zeros(self.problem.n_rows), Status.SOLVED, 1)

    def do_count_down(self, solution: Solution) -> object:
        return Solution(solution.impulses, solution.status, -5)

    def do_count_on(self, solution: Solution) -> object:
        return Solution(solution.impulses, solution.status, 10**5000)

    def do_mask(self, solution: Solution) -> object:
        return Solution(np.ma.masked_array(solution.impulses, mask=True), solution.status, 1)

    def do_whisper(self, solution: Solution) -> object:
        return Solution(solution.impulses, solution.status, solution.iterations, "half \ud800 of a letter")

    def do_explain(self, solution: Solution) -> object:
        return Solution(solution.impulses, solution.status, solution.iterations, "well " * 10**6)

    def do_talk(self, solution: Solution) -> object:
        return Solution(solution.impulses, solution.status, solution.iterations, "m" * 2**25)

    # faults in its own process

    def do_exit(self, solution: Solution) -> object:
        os._exit(7)

    def do_segfault(self, solution: Solution) -> object:
        return ctypes.string_at(0)

    def do_abort(self, solution: Solution) -> object:
        os.abort()

    def do_sleep(self, solution: Solution) -> object:
        time.sleep(1000)
        return solution

    def do_spin(self, solution: Solution) -> object:
        for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, set(signal.Signals))
        while True:
            pass

    def do_allocate(self, solution: Solution) -> object:
        held = []
        while True:
            held.append(np.ones(2**24))

    def do_allocate_for_ever(self, solution: Solution) -> object:
        held = []
        while True:
            with contextlib.suppress(MemoryError):
                held.append(np.ones(2**20))

    def do_allocate_in_c(self, solution: Solution) -> object:
        system = ctypes.CDLL(None)
        system.malloc.restype, system.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
        while True:
            ctypes.memset(system.malloc(2**22), 1, 2**22)

    def do_fail_to_factorise(self, solution: Solution) -> object:
        try:
            return np.ones(2**40)
        except MemoryError as error:
            raise RuntimeError("no room for the factor") from error

    def do_die(self, solution: Solution) -> object:
        os.kill(os.getpid(), signal.SIGKILL)
        return solution

    def do_write(self, solution: Solution) -> object:
        values = self.problem.free_velocity
        values.setflags(write=True)
        values[0] += 1.0
        return solution

    def do_print(self, solution: Solution) -> object:
        print("noise " * 1000)
        raise RuntimeError("after much noise")

    def do_print_gigabytes(self, solution: Solution) -> object:
        for _ in range(4096):
            with contextlib.suppress(OSError):
                os.write(1, b"noise " * 2**18)
        return solution

    def do_patch(self, solution: Solution) -> object:
        patch_everything()
        return self.do_lie(solution)

    def do_move(self, solution: Solution) -> object:
        os.chdir(tempfile.mkdtemp())
        os.rmdir(os.getcwd())
        return solution

    def do_unsettle(self, solution: Solution) -> object:
        unsettle()
        return solution

    def do_close(self, solution: Solution) -> object:
        os.closerange(0, 1000)
        return solution

    def do_hang_up(self, solution: Solution) -> object:
        os.closerange(3, 1000)
        time.sleep(1000)
        return solution

    def do_stop_itself(self, solution: Solution) -> object:
        os.kill(os.getpid(), signal.SIGSTOP)
        return solution

    def do_set_an_alarm(self, solution: Solution) -> object:
        signal.alarm(1)
        time.sleep(1000)
        return solution

    def do_leave_slowly(self, solution: Solution) -> object:
        atexit.register(time.sleep, 1000)
        threading.Thread(target=time.sleep, args=(1000,)).start()
        _kept.append(SlowToGo())
        return solution

    def do_litter(self, solution: Solution) -> object:
        tempfile.mkdtemp()
        tempfile.mkstemp()
        return solution

    # attacks on other processes

    def do_start_threads(self, solution: Solution) -> object:
        for _ in range(4):  # a computation that lets other threads of Python work, and never ends
            threading.Thread(target=hashlib.pbkdf2_hmac, args=("sha256", b"", b"", 2**31 - 1)).start()
        return solution

    def do_start_processes(self, solution: Solution) -> object:
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"], start_new_session=True)
        _forked(lambda: time.sleep(1000))
        _forked(lambda: _forked(_spin_deaf))  # its parent ends immediately
        return solution

    def do_return_twice(self, solution: Solution) -> object:
        os.fork()
        return solution

    def do_run_away(self, solution: Solution) -> object:
        """Start a chain of processes, in which each one forks the next and ends."""
        _forked(_run_away)
        return solution

    def do_kill_its_supervisor(self, solution: Solution) -> object:
        _forked(_spin_deaf)
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(1000)
        return solution

    def do_stop_its_supervisor(self, solution: Solution) -> object:
        _forked(_spin_deaf)
        os.kill(os.getppid(), signal.SIGSTOP)
        time.sleep(1000)
        return solution

    def do_forge(self, solution: Solution) -> object:
        """Write forged answers into every open connection."""
        for descriptor in range(3, 100):
            with contextlib.suppress(OSError):
                socket.socket(fileno=os.dup(descriptor)).send(b"\x00" * 7 + b"\x04null" * 100)
        return solution


def patch_everything() -> None:
    """Replace the judge, the store and the clock by versions that favour the solver."""
    import proxbench.bench.measure.contacts.case
    import proxbench.bench.store.outcome
    import proxbench.bench.store.store
    import proxbench.problems
    from proxbench.problems import judge as judging

    flatter: Any = lambda *arguments, **options: judging  # noqa: E731
    for module in (
        proxbench.bench.measure.contacts.case,
        proxbench.bench.store.outcome,
        proxbench.bench.store.store,
        proxbench.problems,
    ):
        for name in ("judge", "point_outcome", "_put", "Residual"):
            if hasattr(module, name):
                setattr(module, name, flatter)
    time.time = time.monotonic = time.perf_counter = lambda: 0.0


def unsettle() -> None:
    """Change the global state of a process: random state, numpy's error state, garbage collection, environment."""
    np.random.seed(0)  # noqa: NPY002
    random.seed(0)
    np.seterr(all="raise")
    gc.disable()
    os.environ.clear()
    sys.setrecursionlimit(60)
    os.umask(0o777)


def _forked(act: Any) -> None:
    if os.fork() == 0:
        act()
        os._exit(0)


def _spin() -> None:
    while True:
        pass


def _spin_deaf() -> None:
    os.setsid()
    signal.pthread_sigmask(signal.SIG_BLOCK, set(signal.Signals))
    _spin()


def _run_away() -> None:
    end = time.monotonic() + 100.0
    while time.monotonic() < end:
        time.sleep(1e-3)
        if os.fork():
            os._exit(0)
        os.setsid()
