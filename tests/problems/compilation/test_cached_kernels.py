"""A cached kernel is used only while its sources are unchanged; its bits do not depend on what is compiled first."""

import importlib
import os
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import proxbench.problems
import proxbench.solvers
import pytest
from numba import config
from numba.core.dispatcher import Dispatcher

SOURCES = {
    "numbers": "FACTOR = 3.0\nOTHER = 1.0\n",
    "called": "from numba import njit\n\n\n@njit(cache=True)\ndef square(x):\n    return x * x\n",
    "caller": (
        "from numba import njit\nfrom .called import square\nfrom .numbers import FACTOR\n\n\n"
        "@njit(cache=True)\ndef scaled(x):\n    return FACTOR * square(x)\n"
    ),
}
CALLS = """
import os
from pathlib import Path
import proxbench.problems
folder = Path({folder!r})
proxbench.problems.__path__.insert(0, str(folder))
for changed in {changes}:
    for name, text in changed.items():
        (folder / f"{{name}}.py").write_text(text)
    os.utime(folder / "caller.py")
    if os.fork() == 0:
        from proxbench.problems.caller import scaled
        print(scaled(2.0), sum(scaled.stats.cache_hits.values()), flush=True)
        os._exit(0)
    os.wait()
"""


@pytest.mark.slow
def test_a_kernel_is_compiled_again_only_after_a_change_of_what_it_calls_or_of_a_number(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A new process imports the kernel after each change of its sources; ``hits`` counts its uses of the cache."""
    changes: list[tuple[dict[str, str], float, int]] = [
        (SOURCES, 12.0, 0),
        ({"numbers": "FACTOR = 3.0\nOTHER = 2.0\n"}, 12.0, 1),
        ({"called": SOURCES["called"].replace("x * x", "x + x + x")}, 18.0, 0),
        ({}, 18.0, 1),
        ({"numbers": "FACTOR = 5.0\n"}, 30.0, 0),
    ]
    code = CALLS.format(folder=str(tmp_path), changes=[changed for changed, _, _ in changes])
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path_factory.mktemp("cache")),
        "NUMBA_DISABLE_JIT": "0",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    found = [(float(value), int(hits)) for value, hits in map(str.split, done.stdout.splitlines())]
    assert found == [(value, hits) for _, value, hits in changes]


def test_numba_tests_once_per_folder_whether_it_can_write_a_cache(tmp_path: Path) -> None:
    """And the files in the cache have the names that numba gives them: each contains the line of its kernel."""
    code = """
from numba.core.caching import CacheImpl, UserProvidedCacheLocator, _CacheLocator
tested, test = [], _CacheLocator.ensure_cache_path
_CacheLocator.ensure_cache_path = lambda locator: tested.append(locator.get_cache_path()) or test(locator)
import proxbench.solvers.sweeps.one_contact, proxbench.solvers.sweeps.any_laws
from proxbench.problems.compilation.cached_kernels import _is_kernel
from proxbench.solvers.sweeps import any_laws
kernels = [value for value in vars(any_laws).values() if _is_kernel(value)]
names = [(UserProvidedCacheLocator(one.py_func, one.py_func.__code__.co_filename), one) for one in kernels]
print(len(kernels) > 2, len(tested) > 1, len(set(tested)) == len(tested))
print(all(own.get_disambiguator() == one._cache._impl.locator.get_disambiguator() for own, one in names))
print(all(own.get_cache_path() == one._cache._impl.locator.get_cache_path() for own, one in names))
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split() == ["True"] * 5


def kernels() -> dict[str, Any]:
    """Return the kernels of the package by module and name."""
    found = {}
    for package in (proxbench.problems, proxbench.solvers):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("warp_kernels"):  # needs an extra
                for value in vars(importlib.import_module(module.name)).values():
                    if isinstance(value, Dispatcher):
                        found[f"{value.py_func.__module__}.{value.py_func.__name__}"] = value
    return found


def called_kernels(kernel: Any) -> Iterator[Any]:
    """Yield the kernels that a kernel calls, directly or from code that numba inlines."""
    for name in kernel.py_func.__code__.co_names:
        value = kernel.py_func.__globals__.get(name)
        if isinstance(value, Dispatcher) and value is not kernel:
            yield value
            if value.targetoptions.get("inline") == "always":
                yield from called_kernels(value)


@pytest.mark.skipif(config.DISABLE_JIT, reason="numba is switched off")
@pytest.mark.parametrize(("option", "default"), [("fastmath", False), ("error_model", "python")])
def test_a_kernel_states_the_options_that_it_would_otherwise_inherit(option: str, default: object) -> None:
    """numba compiles a kernel without such an option with that of the first caller, and keeps it in the cache."""
    every = kernels()
    assert len(every) > 200
    inherited = {
        f"{called.py_func.__name__} from {name}"
        for name, kernel in every.items()
        if kernel.targetoptions.get("inline") != "always" and kernel.targetoptions.get(option, default) != default
        for called in called_kernels(kernel)
        if called.targetoptions.get("inline") != "always" and option not in called.targetoptions
    }
    assert inherited == set()
