"""Numerical libraries use one thread where rounding must not depend on the number of cores."""

import subprocess
import sys

import scipy.linalg  # noqa: F401
from proxbench.solvers.iteration.cores import one_library_thread
from threadpoolctl import threadpool_info, threadpool_limits


def threads() -> list[int]:
    return [library["num_threads"] for library in threadpool_info()]


def test_libraries_use_one_thread_inside_and_as_many_as_before_afterwards() -> None:
    with threadpool_limits(2):
        before = threads()
        with one_library_thread():
            assert set(threads()) == {1}
            with one_library_thread():
                assert set(threads()) == {1}
            assert set(threads()) == {1}
        assert threads() == before
    assert max(before) > 1


def test_a_library_that_methods_import_later_uses_one_thread_too() -> None:
    program = """
import sys
from proxbench.solvers.iteration.cores import one_library_thread
assert "scipy.linalg" not in sys.modules
with one_library_thread():
    import scipy.linalg
    from threadpoolctl import threadpool_info
    assert {library["num_threads"] for library in threadpool_info()} == {1}, threadpool_info()
"""
    subprocess.run([sys.executable, "-c", program], check=True)
