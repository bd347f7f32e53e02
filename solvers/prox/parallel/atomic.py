"""Atomic operations on arrays of 64-bit integers, by which threads of compiled kernels share work.

numba has atomic operations for GPUs only. Each function here is one instruction of LLVM. Memory is
ordered such that a thread that reads a sum with ``read`` sees everything that another thread wrote before ``add``.
"""

from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

SPINS_BEFORE_YIELD = 20_000
"""Number of readings, about 50 µs, after which a waiting thread yields its core, possibly to the thread it waits for.

A sweep over a colour of a thousand contacts takes about as long. After a yield, another program may use the core for
milliseconds.
"""

yield_core = types.ExternalFunction("sched_yield", types.intc())


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    struct = context.make_array(array_type)(context, builder, array)
    return cgutils.get_item_pointer(  # type: ignore[no-untyped-call]
        context, builder, array_type, struct, [index], wraparound=False
    )


def _swap_if_equal(typing_context, array, index, expected, new):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = _pointer(context, builder, signature.args[0], *arguments[:2])
        result = builder.cmpxchg(pointer, arguments[2], arguments[3], "acq_rel", "acquire")
        return builder.extract_value(result, 1)

    return types.boolean(array, types.intp, types.int64, types.int64), generate


swap_if_equal: Any = intrinsic(_swap_if_equal)
"""Replace ``array[index]`` by ``new`` if it is ``expected``; return whether it was (array, index, expected, new)."""


def _add(typing_context, array, index, number):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = _pointer(context, builder, signature.args[0], *arguments[:2])
        return builder.atomic_rmw("add", pointer, arguments[2], "acq_rel")

    return types.int64(array, types.intp, types.int64), generate


add: Any = intrinsic(_add)
"""Add ``number`` to ``array[index]``; return its previous value (array, index, number)."""


def _read(typing_context, array, index):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        pointer = _pointer(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(pointer, "acquire", 8)

    return types.int64(array, types.intp), generate


read: Any = intrinsic(_read)
"""Return ``array[index]`` as the last thread that wrote it has left it (array, index)."""


@njit(cache=True, error_model="numpy", fastmath=False)
def wait_for(array, index, minimum):  # type: ignore[no-untyped-def]
    """Wait until ``array[index]`` is at least ``minimum``."""
    spins = 0
    while read(array, index) < minimum:
        spins += 1
        if spins > SPINS_BEFORE_YIELD:
            yield_core()
