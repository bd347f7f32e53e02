"""Out-of-memory errors are recognised, however a library raises them."""

import pytest
from proxbench.bench.isolation.child import MAX_CAUSES, _is_caused_by_memory


def raised(error: BaseException, cause: BaseException | None = None, context: BaseException | None = None) -> Exception:
    """Return an exception that was raised from a cause, or while another one was handled."""
    outer = ValueError("outer")
    outer.__context__ = error if cause is None else context
    if cause is not None:
        outer.__cause__ = cause
    return outer


def chain(length: int) -> BaseException:
    """Return an exception that was caused by a MemoryError through ``length`` other exceptions."""
    error: BaseException = MemoryError()
    for _ in range(length):
        error = raised(error)
    return error


def hidden() -> Exception:
    """Return an exception that was raised ``from None`` while a MemoryError was handled."""
    outer = raised(MemoryError())
    outer.__suppress_context__ = True
    return outer


@pytest.mark.parametrize(
    ("error", "is_memory"),
    [
        (MemoryError(), True),
        (ValueError("other"), False),
        (raised(ValueError("inner")), False),
        (raised(MemoryError()), True),
        (raised(ValueError(), cause=MemoryError()), True),
        (hidden(), False),
        (raised(ValueError(), cause=ValueError("the cause"), context=MemoryError()), False),
        (chain(MAX_CAUSES - 1), True),
        (chain(2 * MAX_CAUSES), False),
    ],
)
def test_memory_error_is_found_among_the_causes_of_an_error(error: BaseException, is_memory: bool) -> None:
    assert _is_caused_by_memory(error) is is_memory


def test_a_cycle_of_error_causes_does_not_loop_forever() -> None:
    first, second = ValueError("first"), ValueError("second")
    first.__cause__, second.__cause__ = second, first
    assert not _is_caused_by_memory(first)
