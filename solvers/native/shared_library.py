"""The solver Shared, which calls a shared library that exports the functions of ``proxbench.h``.

The structures of a solve are created when the problem is prepared. A call therefore has little overhead: it sets the
limits, enters the library, and copies the impulses to memory that the library does not know. Guard entries lie before
and after the memory of the impulses, and their bytes must not change. The impulses are NaN before each call, which
reveals entries that the library does not write.
"""

import ctypes
from ctypes import POINTER, byref, c_char_p, c_int32, c_void_p
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

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
from .elf import elf_length, own_processor, processor_of
from .native_solver import (
    MAX_COUNT,
    BrokenInterfaceError,
    NativeSolver,
    SolverFacts,
    check_interface,
    granted_threads,
    refused_solution,
    status_of,
)
from .problem_arrays import ProblemArrays
from .structures import FUNCTIONS, OBSERVER, STATUSES, Description, Problem, Request, Result, sized, text_of

GUARD = 64
"""Number of guard entries before and after the impulses, which a solver must not change."""

_GUARD_BYTES = np.full(GUARD, -1.25e-250).tobytes()

_WITHOUT_OBSERVER = OBSERVER()


@dataclass(frozen=True)
class Shared(NativeSolver):
    """A solver in a shared library, ``Shared('./libmine.so')``.

    Attributes:
        path: the library, absolute or relative to the working folder.
        options: text that its ``proxbench_prepare`` receives.
        facts: the description that the library returns.
        library: the loaded library.

    Raises:
        SolverError: if the file is missing, truncated, built for another processor or not a shared library, lacks a
            function of ``proxbench.h``, has another version of the interface, or describes itself incorrectly.
    """

    library: ctypes.CDLL = field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "shared library"
    example: ClassVar[str] = "Shared(./libmine.so)"

    def _describe(self) -> SolverFacts:
        self._check_file()
        try:
            library = ctypes.CDLL(str(self.file))
        except OSError as error:
            raise SolverError(
                f"{self.path} cannot be loaded as a shared library ({error}); build it with cc -shared -fPIC."
            ) from None
        missing = [name for name in FUNCTIONS if not hasattr(library, name)]
        if missing:
            raise SolverError(
                f"shared library {self.path} has no function {missing[0]}; include proxbench.h, which is in the folder "
                "that python -m proxbench.solvers.native prints, and define its functions."
            )
        library.proxbench_describe.restype = POINTER(Description)
        library.proxbench_prepare.argtypes = POINTER(Problem), c_char_p, POINTER(c_void_p), POINTER(c_char_p)
        library.proxbench_free.argtypes, library.proxbench_free.restype = (c_void_p,), None
        library.proxbench_solve.restype = c_int32
        object.__setattr__(self, "library", library)
        source, pointer = f"shared library {self.path}", library.proxbench_describe()
        if not pointer:
            raise SolverError(f"proxbench_describe of {source} returns NULL; return the address of a pb_description.")
        description = pointer.contents
        check_interface(source, description.interface_version)
        if description.size < ctypes.sizeof(Description):
            raise SolverError(
                f"pb_description of {source} has size {description.size}; set size to sizeof(pb_description)."
            )
        masks = description.forms, description.laws, description.flags
        return SolverFacts.checked(
            source,
            text_of(description.name),
            text_of(description.version),
            description.model,
            description.sides,
            masks=masks,
        )

    def _check_file(self) -> None:
        """Raise ``SolverError`` if the file is for another processor, or truncated, which would kill this process."""
        try:
            length, size = elf_length(self.file), self.file.stat().st_size
            processor, own_name = processor_of(self.file), own_processor()
        except OSError as error:
            raise SolverError(f"cannot read {self.path}: {error.strerror}; make it readable.") from None
        if size < length:
            raise SolverError(f"shared library {self.path} is truncated after {size} bytes; build or copy it again.")
        if processor and own_name and processor != own_name:
            raise SolverError(
                f"shared library {self.path} is built for {processor}, but this process runs on {own_name}; "
                f"build it for {own_name}."
            )

    def prepare(self, problem: ContactProblem) -> Prepared:
        """Copy the arrays that the library requests, and call ``proxbench_prepare`` with them."""
        self.check_supports(problem)
        return PreparedLibrary(self, problem)


class PreparedLibrary:
    """The solver of a library, prepared for one problem."""

    def __init__(self, solver: Shared, problem: ContactProblem) -> None:
        self._solver, self._arrays = solver, ProblemArrays.of(problem, solver.facts.forms)
        self._n_rows, self._source = problem.n_rows, f"shared library {solver.path}"
        library = solver.library
        self._call, self._free = library.proxbench_solve, library.proxbench_free
        prepared, message = c_void_p(), c_char_p()
        arguments = byref(self._arrays.structure), solver.options.encode(), byref(prepared), byref(message)
        self._prepare_status = status_of(self._source, library.proxbench_prepare(*arguments))
        self._handle, self._message = prepared, text_of(message.value)
        self._memory = np.empty(2 * GUARD + self._n_rows)
        self._memory[:GUARD] = self._memory[GUARD + self._n_rows :] = np.frombuffer(_GUARD_BYTES)
        self._impulses, self._start = self._memory[GUARD : GUARD + self._n_rows], np.zeros(self._n_rows)
        self._guard_before, self._guard_after = self._memory[:GUARD], self._memory[GUARD + self._n_rows :]
        self._request: Request = sized(Request)
        self._result: Result = sized(Result)
        self._request.threads, self._request.start = granted_threads(), self._start.ctypes.data
        self._result.impulses = self._impulses.ctypes.data
        self._addresses = byref(self._request), byref(self._result)

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Call ``proxbench_solve``; see ``Prepared.solve``.

        Raises:
            BrokenInterfaceError: if the library writes beyond the impulses, or returns an unknown status.
        """
        check_stop(stop)
        if self._prepare_status is not Status.SOLVED:
            return refused_solution(self._n_rows, self._prepare_status, self._message)
        request, result = self._request, self._result
        request.tolerance, request.max_seconds = stop.tolerance, stop.max_seconds
        request.max_iterations = min(stop.max_iterations, MAX_COUNT)
        self._set_start(start)
        self._impulses.fill(np.nan)
        result.iterations, result.message = 0, None
        code = self._call(self._handle, *self._addresses) if observe is None else self._observed(observe)
        if self._guard_before.tobytes() != _GUARD_BYTES or self._guard_after.tobytes() != _GUARD_BYTES:
            raise BrokenInterfaceError(
                f"{self._source} wrote beyond the {self._n_rows} impulses of the problem; write n_rows numbers."
            )
        if not 0 <= code < len(STATUSES):
            status_of(self._source, code)
        message = result.message
        text = text_of(message, 2000) if message else ""
        return _solution(self._impulses.copy(), STATUSES[code], result.iterations, text)

    def _set_start(self, start: FloatArray | None) -> None:
        if start is None:
            self._start.fill(0.0)
        else:
            self._start[:] = start_impulses(start, self._n_rows)

    def _observed(self, observe: Observer) -> int:
        """Solve with an observer; raise its first exception after the library has returned."""
        errors: list[BaseException] = []

        def show(context: Any, iteration: int, address: int) -> None:
            if errors:
                return
            try:
                view = np.ctypeslib.as_array((ctypes.c_double * self._n_rows).from_address(address))
                view.setflags(write=False)
                observe(iteration, view)
            except BaseException as error:
                errors.append(error)

        self._request.observe = OBSERVER(show)
        try:
            code = int(self._call(self._handle, *self._addresses))
        finally:
            self._request.observe = _WITHOUT_OBSERVER
        if errors:
            raise errors[0]
        return code

    def __del__(self) -> None:
        handle = getattr(self, "_handle", None)
        if handle is not None and handle.value:
            self._free(handle)
            handle.value = None


def _solution(impulses: FloatArray, status: Status, iterations: int, message: str) -> Solution:
    """Return ``Solution(...)`` in half the time of its constructor, which sets the attributes indirectly."""
    solution = object.__new__(Solution)
    attributes = solution.__dict__
    attributes["impulses"], attributes["status"] = impulses, status
    attributes["iterations"], attributes["message"] = iterations, message
    return solution
