"""Kernels in numba's cache: each is valid while its sources are unchanged, and may be loaded before its first call.

The machine code of a kernel contains that of all kernels it calls. By default, numba compiles a cached kernel again
only if the file that defines the kernel changes. After an upgrade, a kernel could then still run old code of kernels in
other files. Here, each kernel of the package is cached with a digest of its file, of the files of all kernels and named
tuples that this file imports, directly or indirectly, and of all imported numbers, which are compiled as constants.
The digest depends on neither the times nor the folder of the files.
"""

import os
import sys
from hashlib import sha256
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
from numba import config
from numba.core.caching import CacheImpl, FunctionCache, _CacheLocator
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic

PACKAGE = __name__.partition(".")[0]

_LOCATORS: list[Any] = CacheImpl._locator_classes
"""Classes that numba asks in turn where to cache a kernel."""

_FOUND: dict[tuple[str, str], Any] = {}
"""Which of numba's classes can write a cache, by numba's option for the folder of caches and the folder of a file."""

_DIGESTS: dict[str, bytes] = {}
"""Digests of modules by name; that of a module with kernels is computed when its first kernel is defined."""


class SourceLocator(_CacheLocator):
    """The folder in which numba's own locators cache a kernel of this package, and the digest of its sources."""

    def __init__(self, locator: Any, digest: bytes, py_file: str) -> None:
        self._locator, self._digest = locator, digest
        self._py_file = py_file  # numba names it in warnings about kernels that it cannot cache

    @classmethod
    def from_function(cls, py_func: FunctionType, py_file: str) -> "SourceLocator | None":
        """Return the locator of a kernel; None if the kernel is of another package or its sources cannot be read."""
        module = py_func.__module__
        if not module.startswith(f"{PACKAGE}."):
            return None
        base = _base_locator(py_func, py_file)
        try:
            return cls(base, source_digest(module, py_func.__globals__), py_file) if base else None
        except OSError:
            return None

    def get_cache_path(self) -> Any:
        """Return the folder of the cached kernel."""
        return self._locator.get_cache_path()

    def get_disambiguator(self) -> Any:
        """Return the part of the file name that distinguishes kernels of one name."""
        return self._locator.get_disambiguator()

    def get_source_stamp(self) -> bytes:
        """Return the digest of the sources; a cached kernel with another digest is compiled again."""
        return self._digest


def _base_locator(py_func: FunctionType, py_file: str) -> Any:
    """Return numba's own locator of a kernel, or None.

    numba would test for each kernel whether it can write a file; here, it tests once per folder, which takes a tenth of
    the time of defining a kernel.
    """
    place = str(config.CACHE_DIR), os.path.dirname(py_file)  # type: ignore[attr-defined]
    if place in _FOUND:
        return _FOUND[place](py_func, py_file)
    others = (other for other in _LOCATORS if other is not SourceLocator)
    base = next((locator for other in others if (locator := other.from_function(py_func, py_file))), None)
    if base is not None:
        _FOUND[place] = type(base)
    return base


def source_digest(module: str, names: dict[str, Any]) -> bytes:
    """Return the SHA-256 digest of a module's file, and of what its kernels may use from other files.

    Args:
        module: name of the module.
        names: global names of the module with their values; during its import, those defined before its first kernel.

    Raises:
        OSError: if a file cannot be read.
    """
    if module not in _DIGESTS:
        digest = sha256(Path(names["__file__"]).read_bytes())
        for name, value in sorted(names.items()):
            digest.update(_digest_of(value, module) or _number_bytes(name, value))
        _DIGESTS[module] = digest.digest()
    return _DIGESTS[module]


def _digest_of(value: Any, module: str) -> bytes:
    """Return the digest of the other module of this package that defines a kernel or named tuple, or empty bytes."""
    if isinstance(value, Dispatcher):
        origin = value.py_func.__module__
    elif isinstance(value, _Intrinsic):
        origin = value._defn.__module__
    elif isinstance(value, type) and issubclass(value, tuple):
        origin = value.__module__
    else:
        return b""
    is_other_module = origin != module and origin.startswith(f"{PACKAGE}.")
    return source_digest(origin, vars(sys.modules[origin])) if is_other_module else b""


def _number_bytes(name: str, value: Any) -> bytes:
    """Return bytes that differ for different numbers, arrays and tuples of numbers; none for other values."""
    if isinstance(value, (int, float, complex, np.generic)):
        return f"{name}={value!r};".encode()
    if isinstance(value, tuple):
        return b"".join(_number_bytes(f"{name}[{k}]", part) for k, part in enumerate(value))
    if isinstance(value, np.ndarray):
        return f"{name}={value.dtype}{value.shape};".encode() + value.tobytes()
    return b""


_LOCATORS.insert(0, SourceLocator)


def load_cached_kernels() -> int:
    """Load the kernels of all imported modules that numba has cached for this processor.

    Otherwise, the first call of a kernel with new types loads it, which takes about 5 ms.

    Returns:
        The number of kernels that were loaded, one for each combination of types.
    """
    namespaces = [getattr(module, "__dict__", {}) for module in [*sys.modules.values()]]
    kernels = {id(value): value for namespace in namespaces for value in [*namespace.values()] if _is_kernel(value)}
    return sum(load_overloads(kernel) for kernel in kernels.values())


def _is_kernel(value: Any) -> bool:
    return isinstance(value, Dispatcher) and isinstance(vars(value).get("_cache"), FunctionCache)


def load_overloads(kernel: Any) -> int:
    """Load a kernel from the cache, and return the number of type combinations for which it was loaded."""
    cache, codegen = kernel._cache, kernel.targetctx.codegen()
    missing = [key for key in cache._cache_file._load_index() if tuple(key[0]) not in kernel.overloads]
    usable = [key[0] for key in missing if key == cache._index_key(key[0], codegen)]
    for types in usable:
        kernel.compile(tuple(types))
    return len(usable)
