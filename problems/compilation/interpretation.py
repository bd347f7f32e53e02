"""Interpretation of kernels where it is faster than compilation.

A kernel takes up to half a second to compile. The set-up of one small problem runs each of its kernels once. The
interpreter does this in milliseconds, so ``solve`` interprets the kernels. The results are identical if a kernel uses
only correctly rounded operations, and neither powers nor ``fastmath``.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numba import config
from numba.core.dispatcher import Dispatcher

from .cached_kernels import load_overloads

MAX_INTERPRETED_NUMBERS = 50_000
"""Largest count of numbers that an interpreted kernel reads in one call; such a call may take 0.05 s."""

MAX_INTERPRETED_SECONDS = 0.05
"""Total time for which a kernel is interpreted [s]; then it is compiled, or loaded from the cache in 0.005 s."""

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
        kernels: the faster kernels.
        uses_before_loading: uses of the slower kernels that take about as long as loading the kernels from the cache.
        uses_before_compiling: uses of the slower kernels that take about as long as compiling the kernels.
    """

    def __init__(self, kernels: Sequence[Any], uses_before_loading: int, uses_before_compiling: int) -> None:
        self._kernels, self._limits, self._uses = kernels, (uses_before_loading, uses_before_compiling), 0
        self._in_use = bool(config.DISABLE_JIT)  # type: ignore[attr-defined]

    def should_use(self) -> bool:
        """Return whether to use the faster kernels now; if not, count one use of the slower ones."""
        if not self._in_use:
            self._uses += 1
            is_loaded = self._uses == self._limits[0] and all([load_overloads(kernel) for kernel in self._kernels])
            self._in_use = not _INTERPRETS.get() or is_loaded or self._uses > self._limits[1]
        return self._in_use


def count_numbers(*arguments: Any) -> int:
    """Return the total number of entries of those arguments that are arrays."""
    return sum(argument.size for argument in arguments if isinstance(argument, np.ndarray))


def interpretable(kernel: Any, count: Callable[..., int] = count_numbers) -> Any:
    """Return ``kernel``, whose first calls in functions decorated with ``interprets_kernels`` are interpreted.

    ``count`` takes the arguments of the kernel and returns how many numbers the kernel reads. Calls of a compiled
    kernel do not become slower: numba calls ``_compile_for_args`` only if no compiled version fits the arguments, and
    then calls the function that it returns.
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
