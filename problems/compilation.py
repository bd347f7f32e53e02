"""First calls of kernels: a notice if compilation takes long, and interpretation where it is faster than compilation.

A kernel takes up to half a second to compile. The set-up of one small problem runs each of its kernels once. The
interpreter does this in milliseconds, so ``solve`` interprets the kernels. The results are identical if a kernel uses
only correctly rounded operations, and neither powers nor ``fastmath``.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from mmap import mmap
from types import FunctionType
from typing import Any, ParamSpec, TextIO, TypeVar

import numpy as np
from numba import config
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher

SECONDS_BEFORE_NOTICE = 1.0
"""Compilation time after which the notice is written [s]."""

NOTICE = "Compiling kernels for the first use; they are cached for the next time."
"""Text of the notice on standard error."""

CLEAR_LINE = "\r\x1b[2K"
"""Control sequence of terminals: go to the start of the line and delete it."""


class CompilationListener(event.Listener):
    """A listener that measures the time that kernels take to compile; kernels loaded from the cache do not count.

    Attributes:
        seconds: wall time of all compilations that have ended, counting nested ones once [s].
        kernels: number of functions that were compiled.
    """

    def __init__(self) -> None:
        self.seconds, self.kernels = 0.0, 0
        self._depth, self._begin = 0, 0.0
        self._silent: bytearray | mmap = bytearray(1)
        self._stream: TextIO | None = None

    @property
    def is_silent(self) -> bool:
        """Whether no further notice is written."""
        return bool(self._silent[0])

    def silence(self) -> None:
        """Write no further notice."""
        self._silent[0] = 1

    def share_with_forks(self) -> None:
        """Let this process and its forks write one notice in total, to the current standard error.

        A forked process may redirect its own standard error.
        """
        silent = mmap(-1, 1)
        silent[0] = self._silent[0]
        self._silent, self._stream = silent, os.fdopen(os.dup(2), "w")

    def on_start(self, compilation: event.Event) -> None:
        """Count the compilation, and write the notice if earlier ones took too long."""
        now = time.perf_counter()
        if self._depth == 0:
            self._begin = now
        self._depth, self.kernels = self._depth + 1, self.kernels + 1
        self._write_notice(now)

    def on_end(self, compilation: event.Event) -> None:
        """Write the notice if all compilations so far took too long, and add the time unless it is part of another."""
        now = time.perf_counter()
        self._write_notice(now)
        self._depth -= 1
        if self._depth == 0:
            self.seconds += now - self._begin

    def _write_notice(self, now: float) -> None:
        """Write the notice once, if compilations have taken too long by the time ``now``."""
        if not self.is_silent and self.seconds + now - self._begin > SECONDS_BEFORE_NOTICE:
            self.silence()
            if self._stream is None:
                print(NOTICE, file=sys.stderr, flush=True)
            else:  # another process may show a progress bar on the same line
                print(f"{CLEAR_LINE if self._stream.isatty() else ''}{NOTICE}", file=self._stream, flush=True)


COMPILATION = CompilationListener()
"""The compilations of this process."""

event.register("numba:compile", COMPILATION)  # type: ignore[no-untyped-call]


def load_cached_kernels() -> int:
    """Load the kernels of all imported modules that numba has cached for this processor.

    Otherwise the first call of a kernel with new types loads it, which takes about 5 ms.

    Returns:
        The number of kernels that were loaded, one for each combination of types.
    """
    names = [getattr(module, "__dict__", {}) for module in [*sys.modules.values()]]
    kernels = {id(value): value for own in names for value in [*own.values()] if _is_kernel(value)}
    return sum(_load_overloads(kernel) for kernel in kernels.values())


def _is_kernel(value: Any) -> bool:
    return isinstance(value, Dispatcher) and isinstance(vars(value).get("_cache"), FunctionCache)


def _load_overloads(kernel: Any) -> int:
    stored, codegen = kernel._cache, kernel.targetctx.codegen()
    left = [key for key in stored._cache_file._load_index() if tuple(key[0]) not in kernel.overloads]
    usable = [key[0] for key in left if key == stored._index_key(key[0], codegen)]
    for types in usable:
        kernel.compile(tuple(types))
    return len(usable)


MAX_INTERPRETED_NUMBERS = 50_000
"""Largest count of numbers that an interpreted kernel reads in one call; such a call may take 0.05 s."""

MAX_INTERPRETED_SECONDS = 0.05
"""Time for which each kernel is interpreted [s]; then it is compiled, or loaded from the cache in 0.005 s."""

_INTERPRETS: ContextVar[bool | None] = ContextVar("interprets", default=None)
"""Whether kernels may be interpreted; False where ``compiled_kernels`` forbids it."""

P = ParamSpec("P")
R = TypeVar("R")


def interprets_kernels(function: Callable[P, R]) -> Callable[P, R]:
    """Return ``function`` in a form in which the interpreter may run the first calls of ``interpretable`` kernels."""

    @wraps(function)
    def run(*arguments: P.args, **options: P.kwargs) -> R:
        token = _INTERPRETS.set(_INTERPRETS.get() is not False)
        try:
            return function(*arguments, **options)
        finally:
            _INTERPRETS.reset(token)

    return run


@contextmanager
def compiled_kernels() -> Iterator[None]:
    """Compile kernels at their first calls within the block, even under ``interprets_kernels``."""
    token = _INTERPRETS.set(False)
    try:
        yield
    finally:
        _INTERPRETS.reset(token)


class DeferredKernels:
    """Kernels that replace slower, already compiled kernels with the same results.

    Within a function decorated with ``interprets_kernels``, they replace the slower ones after ``uses_before_loading``
    uses if they are in the cache, otherwise after ``uses_before_compiling`` uses. Elsewhere, they replace them at once.

    Args:
        kernels: the kernels.
        uses_before_loading: uses of the slower kernels that take about as long as loading the kernels from the cache.
        uses_before_compiling: uses of the slower kernels that take about as long as compiling the kernels.
    """

    def __init__(self, kernels: Sequence[Any], uses_before_loading: int, uses_before_compiling: int) -> None:
        self._kernels, self._limits, self._uses = kernels, (uses_before_loading, uses_before_compiling), 0
        self._in_use = bool(config.DISABLE_JIT)  # type: ignore[attr-defined]

    def should_use(self) -> bool:
        """Return whether to use the kernels now; if not, count one use of the slower ones."""
        if not self._in_use:
            self._uses += 1
            is_loaded = self._uses == self._limits[0] and all([_load_overloads(one) for one in self._kernels])
            self._in_use = not _INTERPRETS.get() or is_loaded or self._uses > self._limits[1]
        return self._in_use


def count_numbers(*arguments: Any) -> int:
    """Return the number of entries of all arrays."""
    return sum(argument.size for argument in arguments if isinstance(argument, np.ndarray))


def interpretable(kernel: Any, count: Callable[..., int] = count_numbers) -> Any:
    """Return ``kernel``, whose first calls in functions decorated with ``interprets_kernels`` are interpreted.

    ``count`` returns how many numbers the kernel reads when it is called with its arguments. Calls of a compiled
    kernel do not become slower: numba calls ``_compile_for_args`` only if no compiled version fits the arguments, and
    then calls its result.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]  # the kernel is a Python function
        return kernel
    compile_kernel, seconds = kernel._compile_for_args, 0.0

    def interpret(*arguments: Any) -> Any:
        nonlocal seconds
        begin = time.perf_counter()
        with np.errstate(all="ignore"):  # compiled kernels do not warn
            result = _python_function(kernel)(*arguments)
        seconds += time.perf_counter() - begin
        return _as_python_numbers(result)

    def select(*arguments: Any) -> Any:
        if not _INTERPRETS.get() or seconds >= MAX_INTERPRETED_SECONDS:
            return compile_kernel(*arguments)
        return interpret if count(*arguments) <= MAX_INTERPRETED_NUMBERS else compile_kernel(*arguments)

    kernel._compile_for_args = select
    return kernel


@cache
def _python_function(kernel: Any) -> FunctionType:
    """Return the Python function of a kernel, which calls the Python functions of other kernels."""
    function: FunctionType = kernel.py_func
    used = {name: value for name, value in function.__globals__.items() if name in function.__code__.co_names}
    scope = {name: _python_function(value) if isinstance(value, Dispatcher) else value for name, value in used.items()}
    return FunctionType(function.__code__, scope, function.__name__)


def _as_python_numbers(result: Any) -> Any:
    """Return Python numbers for NumPy scalars, as compiled kernels do."""
    if isinstance(result, tuple):
        return tuple(_as_python_numbers(part) for part in result)
    return result.item() if isinstance(result, np.generic) else result
