"""Executable: a solver in a program that reads problems from its standard input and answers on its standard output.

The program keeps running from one solve to the next; ``messages`` defines the protocol. ``Executable`` is for solvers
without a C interface. A call takes two messages through pipes.
"""

import os
import select
import shlex
import subprocess
import time
import weakref
from dataclasses import dataclass, field
from typing import ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import (
    Observer,
    Prepared,
    Solution,
    SolverError,
    Status,
    Stop,
    check_stop,
    start_impulses,
)
from .captured_output import last_line, output_size
from .messages import (
    DESCRIBE,
    HEADER,
    ITERATE,
    LIMITS,
    PREPARE,
    SOLVE,
    Answer,
    Message,
    max_body,
    read_answer,
    read_description,
    read_iterate,
    read_prepared,
)
from .native_solver import (
    MAX_COUNT,
    BrokenInterfaceError,
    NativeSolver,
    SolverFacts,
    granted_threads,
    refused_solution,
    status_of,
)
from .problem_arrays import ProblemArrays
from .structures import INTERFACE

_ALL_THREADS = 2
"""Low bits of the clock identifier of a process (clock_getcpuclockid(3))."""

START_SECONDS = 30.0
"""Wall time within which a program must begin to describe itself after its start [s]."""

_STANDARD_ERROR = 2
"""Descriptor of the standard error that programs inherit."""

END_SECONDS = 1.0
"""Wall time within which a program must exit after it closes its output [s]."""


@dataclass(frozen=True)
class Executable(NativeSolver):
    """A solver in a program, ``Executable('./mine')``.

    Attributes:
        path: the program, absolute or relative to the working folder.
        options: its arguments, split as a shell splits them.
        facts: its description of itself.
        program: the running program.

    Raises:
        SolverError: if the file is missing or cannot be started, or if the program exits, does not answer, or has
            another version of the interface.
    """

    program: "Program" = field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "executable"
    example: ClassVar[str] = "Executable(./mine)"

    def _describe(self) -> SolverFacts:
        if not os.access(self.file, os.X_OK):
            raise SolverError(f"{self.kind} {self.path} is not executable; run chmod +x {self.path}.")
        program = Program([str(self.file), *shlex.split(self.options)], f"{self.kind} {self.path}")
        object.__setattr__(self, "program", program)
        return program.facts

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Send the arrays that the program requests, and wait until it has prepared them."""
        self.check_supports(problem)
        return PreparedProgram(self.program, problem)

    def processor_seconds(self) -> float:
        """Return the processor time of the program [s]; 0 if the system does not count it."""
        return self.program.processor_seconds()


class Program:
    """A running program; a forked process starts its own copy.

    Attributes:
        source: its name in messages.
        facts: its description of itself.
        prepared: object that identifies the problem that it prepared last.
    """

    def __init__(self, command: list[str], source: str) -> None:
        self._command, self.source = command, source
        self.prepared: object = None
        self.facts = self._start()

    def processor_seconds(self) -> float:
        """Return the processor time of the program so far [s]; 0 if the system does not count it."""
        try:
            return time.clock_gettime(~self._child.pid << 3 | _ALL_THREADS)
        except OSError:  # the program has ended, or the system is not Linux
            return 0.0

    def discard(self) -> None:
        """End the program; the next solve starts it again."""
        self._child.kill()
        self._owner = 0

    def ensure_own(self) -> None:
        """Start the program again if it was discarded, or in a forked process."""
        if self._owner != os.getpid():
            self.facts = self._start()

    def send(self, kind: int, code: int, *parts: bytes) -> None:
        """Send a message.

        Raises:
            SolverError: if the program has ended.
        """
        content = memoryview(b"".join((HEADER.pack(sum(map(len, parts)), kind, code), *parts)))
        try:
            while content:
                content = content[os.write(self._input, content) :]
        except OSError:
            raise self._exit_error() from None

    def receive(self, kinds: tuple[int, ...], n_rows: int) -> Message:
        """Return the next message about a problem of ``n_rows``.

        Raises:
            SolverError: if the program has ended.
            BrokenInterfaceError: if the program sends another kind of message.
        """
        header = self._read(HEADER.size)
        length, kind, code = HEADER.unpack(header)
        if kind not in kinds or length > max_body(n_rows):
            raise BrokenInterfaceError(
                f"{self.source} sent {header!r}, which does not begin an answer; write answers to standard output "
                "as messages of the protocol, and all else to standard error."
            )
        return Message(kind, code, self._read(length))

    def _start(self) -> SolverFacts:
        """Start the program, and return its description of itself."""
        self._output_before = output_size(_STANDARD_ERROR)
        try:
            child = subprocess.Popen(self._command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as error:
            raise SolverError(
                f"{self.source} cannot be started: {error.strerror}; build it for this machine."
            ) from None
        assert child.stdin is not None
        assert child.stdout is not None
        self._child, self._owner, self.prepared = child, os.getpid(), None
        self._input, self._output = child.stdin.fileno(), child.stdout.fileno()
        weakref.finalize(self, _end_program, child, self._owner)
        self.send(DESCRIBE, INTERFACE)
        answers = select.poll()
        answers.register(self._output, select.POLLIN)
        if not answers.poll(1e3 * START_SECONDS):
            self.discard()
            raise SolverError(
                f"{self.source} has not answered within {START_SECONDS:g} s of its start; read messages from standard "
                "input, and flush standard output after each answer."
            )
        return read_description(self.source, self.receive((DESCRIBE,), 0))

    def _read(self, length: int) -> bytes:
        content = os.read(self._output, length)
        if len(content) == length:
            return content
        parts, remaining = [content], length - len(content)
        while remaining and parts[-1]:
            parts.append(os.read(self._output, remaining))
            remaining -= len(parts[-1])
        if remaining:
            raise self._exit_error()
        return b"".join(parts)

    def _exit_error(self) -> SolverError:
        try:
            code = self._child.wait(END_SECONDS)
        except subprocess.TimeoutExpired:
            return SolverError(f"{self.source} closed its standard output; answer on it until standard input ends.")
        how = f"with exit code {code}" if code >= 0 else f"killed by signal {-code}"
        line = last_line(_STANDARD_ERROR, self._output_before)
        remedy = f"it wrote {line!r} to standard error" if line else "answer messages until standard input ends"
        return SolverError(f"{self.source} ended {how}; {remedy}.")


class PreparedProgram:
    """The solver of a program, prepared for one problem."""

    def __init__(self, program: Program, problem: ContactProblem) -> None:
        self._program, self._n_rows, self._token = program, problem.n_rows, object()
        self._content = ProblemArrays.of(problem, program.facts.forms).message()
        self._prepare()

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Solve in the program; see ``Prepared.solve``. The default message is the time by the program's own clock.

        Raises:
            SolverError: if the program has ended.
            BrokenInterfaceError: if the program sends something that is not an answer.
        """
        check_stop(stop)
        program, n_rows = self._program, self._n_rows
        program.ensure_own()
        if program.prepared is not self._token:
            self._prepare()
        if self._prepare_status is not Status.SOLVED:
            return refused_solution(n_rows, self._prepare_status, self._message)
        first = start_impulses(start, n_rows)
        limits = stop.tolerance, stop.max_seconds, min(stop.max_iterations, MAX_COUNT), granted_threads()
        program.send(SOLVE, 0, LIMITS.pack(*limits, observe is not None), first.tobytes())
        try:
            answer = self._answer(observe)
        except BaseException:  # the next messages of the program would belong to this solve
            program.discard()
            raise
        status = status_of(program.source, answer.code)
        own_seconds = f"{answer.seconds:.3g} s by its own clock" if answer.seconds > 0.0 else ""
        return Solution(answer.impulses, status, answer.iterations, answer.text or own_seconds)

    def _answer(self, observe: Observer | None) -> Answer:
        """Return the solution, and pass the iterates that come before it to the observer."""
        source, n_rows = self._program.source, self._n_rows
        kinds = (SOLVE,) if observe is None else (SOLVE, ITERATE)
        while True:
            message = self._program.receive(kinds, n_rows)
            if message.kind == SOLVE:
                return read_answer(source, message)
            if observe is not None:
                observe(*read_iterate(source, message, n_rows))

    def _prepare(self) -> None:
        self._program.ensure_own()
        self._program.send(PREPARE, 0, self._content)
        code, _, self._message = read_prepared(self._program.source, self._program.receive((PREPARE,), 0))
        self._prepare_status = status_of(self._program.source, code)
        self._program.prepared = self._token


def _end_program(child: "subprocess.Popen[bytes]", owner: int) -> None:
    """End a program that this process has started."""
    if owner != os.getpid():
        return
    child.kill()
    child.wait()
    for stream in (child.stdin, child.stdout):
        if stream is not None:
            stream.close()
