"""Numerical libraries use one thread where rounding must not depend on the number of cores."""

import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
import scipy.linalg  # noqa: F401
from proxbench.solvers.iteration.cores import one_library_thread
from threadpoolctl import threadpool_info, threadpool_limits


def threads() -> list[int]:
    """Return the number of threads of the BLAS of NumPy and of SciPy."""
    return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]


@pytest.fixture
def before() -> Iterator[list[int]]:
    with threadpool_limits(2):
        given = threads()
        assert max(given) > 1
        yield given


def test_libraries_use_one_thread_inside_and_as_many_as_before_afterwards(before: list[int]) -> None:
    with one_library_thread():
        assert set(threads()) == {1}
        with one_library_thread():
            assert set(threads()) == {1}
        assert set(threads()) == {1}
    assert threads() == before


def test_an_error_ends_the_limit(before: list[int]) -> None:
    with pytest.raises(ZeroDivisionError), one_library_thread():
        raise ZeroDivisionError
    assert threads() == before


def test_the_limit_holds_until_the_last_of_several_threads_leaves(before: list[int]) -> None:
    entered, may_leave = threading.Event(), threading.Event()

    def stay() -> None:
        with one_library_thread():
            entered.set()
            may_leave.wait()

    other = threading.Thread(target=stay)
    with one_library_thread():
        other.start()
        entered.wait()
    assert set(threads()) == {1}
    may_leave.set()
    other.join()
    assert threads() == before


@pytest.mark.slow
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
