"""Exchange of velocities between bodies and the lanes of a batch, by vector instructions.

A batch holds one quantity of all its contacts in adjacent lanes, while the velocity of a body is adjacent in memory.
Four lanes at a time are read as vectors of four numbers and transposed. numba does not combine scalar instructions into
vectors, so each function here generates instructions of LLVM for vectors; processors without such vectors use smaller
ones. The functions without vectors would read, write and compute the same numbers in the same order.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types, uint64
from numba.core import cgutils
from numba.extending import intrinsic

from ....problems.arrays import FloatArray

LANES = 16
"""Number of contacts in a batch, the smallest number for which compilers vectorise a loop of known length."""

VECTOR = 4
"""Number of lanes that are exchanged at a time."""

BALL_LENGTH = 8
"""Entries of a ball in an array of motions: v, 0, τ and 0, together one cache line."""

NUMBERS = ir.VectorType(ir.DoubleType(), VECTOR)

CONTRACT = ("contract",)
"""Permission to round a product and a sum once, which kernels have by ``fastmath={"contract"}``."""


def cache_lines(count: int) -> FloatArray:
    """Return zeros for ``count`` balls, flat, each of which occupies one cache line."""
    numbers = np.zeros(BALL_LENGTH * (count + 1))
    first = -(numbers.ctypes.data // numbers.itemsize) % BALL_LENGTH
    return numbers[first : first + BALL_LENGTH * count]


def copy_of_lines(numbers: FloatArray) -> FloatArray:
    """Return a copy that begins at a cache line."""
    copy = cache_lines(-(-len(numbers) // BALL_LENGTH))[: len(numbers)]
    copy[:] = numbers
    return copy


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    struct = context.make_array(array_type)(context, builder, array)
    return cgutils.get_item_pointer(  # type: ignore[no-untyped-call]
        context, builder, array_type, struct, [index], wraparound=False
    )


def _load(context: Any, builder: Any, array_type: Any, array: Any, index: Any, to_type: Any) -> Any:
    """Load one entry and convert it."""
    value = builder.load(_pointer(context, builder, array_type, array, index))
    return context.cast(builder, value, array_type.dtype, to_type)


def _four_at(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    """Return a pointer to four successive numbers."""
    return builder.bitcast(_pointer(context, builder, array_type, array, index), NUMBERS.as_pointer())


def _load_four(builder: Any, pointer: Any) -> Any:
    numbers = builder.load(pointer)
    numbers.align = 8
    return numbers


def _store_four(builder: Any, numbers: Any, pointer: Any) -> None:
    builder.store(numbers, pointer).align = 8


def _all_equal(builder: Any, number: Any) -> Any:
    """Return a vector of equal numbers."""
    numbers = ir.Constant(NUMBERS, ir.Undefined)
    for k in range(VECTOR):
        numbers = builder.insert_element(numbers, number, ir.Constant(ir.IntType(32), k))
    return numbers


def _shuffled(builder: Any, first: Any, second: Any, *order: int) -> Any:
    indices = ir.Constant(ir.VectorType(ir.IntType(32), VECTOR), list(order))
    return builder.shuffle_vector(first, second, indices)


def _transposed(builder: Any, rows: Sequence[Any]) -> list[Any]:
    """Return the columns of four vectors."""
    even, odd = (
        [_shuffled(builder, rows[k], rows[k + 1], *order) for k in (0, 2)] for order in ((0, 4, 2, 6), (1, 5, 3, 7))
    )
    halves = (0, 1, 4, 5), (2, 3, 6, 7)
    return [_shuffled(builder, *pair, *half) for half in halves for pair in (even, odd)]


def _gather_four(typing_context, bodies, pair, motion, moves, lane):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        bodies_type, _, motion_type, moves_type, _ = signature.args
        bodies, pair, motion, moves, lane = arguments

        def constant(number: int) -> Any:
            return context.get_constant(types.uint64, number)

        differences, sums = [], []
        for k in range(VECTOR):
            first_lane = builder.add(builder.add(pair, lane), constant(k))
            a, b = (
                _load(context, builder, bodies_type, bodies, index, types.uint64)
                for index in (first_lane, builder.add(first_lane, constant(LANES)))
            )
            v_a, v_b, tau_a, tau_b = (
                _load_four(builder, _four_at(context, builder, motion_type, motion, index))
                for index in (a, b, builder.add(a, constant(VECTOR)), builder.add(b, constant(VECTOR)))
            )
            differences.append(builder.fsub(v_a, v_b))
            sums.append(builder.fadd(tau_a, tau_b))
        columns = _transposed(builder, differences)[:3] + _transposed(builder, sums)[:3]
        for k, column in enumerate(columns):
            index = builder.add(lane, constant(LANES * k))
            _store_four(builder, column, _four_at(context, builder, moves_type, moves, index))
        return context.get_dummy_value()

    return types.void(bodies, types.uint64, motion, moves, types.uint64), generate


_gather_four_lanes: Any = intrinsic(_gather_four)


@njit(cache=True, inline="always")
def gather_moves(bodies, pair, motion, moves):  # type: ignore[no-untyped-def]
    """Write v_i − v_j and τ_i + τ_j of a batch, whose balls begin at ``pair`` of ``bodies``, into ``moves``."""
    for group in range(uint64(LANES // VECTOR)):
        _gather_four_lanes(bodies, pair, motion, moves, uint64(VECTOR) * group)


def _scatter_four(spares_idle: bool) -> Callable[..., Any]:
    def type_and_generate(typing_context, bodies, pair, records, masses, moves, motion, idle, lane):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            bodies_type, _, records_type, _, moves_type, motion_type, _, _ = signature.args
            bodies, pair, records, masses, moves, motion, idle, lane = arguments

            def constant(number: int) -> Any:
                return context.get_constant(types.uint64, number)

            rows = [
                _load_four(
                    builder,
                    _four_at(context, builder, moves_type, moves, builder.add(lane, constant(LANES * k))),
                )
                for k in range(6)
            ]
            zeros = ir.Constant(NUMBERS, [0.0] * VECTOR)
            pushes, torques = _transposed(builder, [*rows[:3], zeros]), _transposed(builder, [*rows[3:], zeros])

            def move(ball: Any, mass: Any, k: int, is_first: bool) -> None:
                """Add P/m to v of the first ball, or subtract it from v of the second, and (n × P)/m from τ."""
                for offset, change, sign in ((0, pushes[k], is_first), (VECTOR, torques[k], False)):
                    index = builder.add(ball, constant(offset))
                    pointer = _four_at(context, builder, motion_type, motion, index)
                    product = builder.fmul(_all_equal(builder, mass), change, flags=CONTRACT)
                    combine = builder.fadd if sign else builder.fsub
                    _store_four(builder, combine(_load_four(builder, pointer), product, flags=CONTRACT), pointer)

            for k in range(VECTOR):
                for side in range(2):
                    offset = builder.add(lane, constant(k + LANES * side))
                    ball = _load(context, builder, bodies_type, bodies, builder.add(pair, offset), types.uint64)
                    mass = _load(context, builder, records_type, records, builder.add(masses, offset), types.float64)
                    if not spares_idle:
                        move(ball, mass, k, side == 0)
                        continue
                    with builder.if_then(builder.icmp_unsigned("!=", ball, idle)):
                        move(ball, mass, k, side == 0)
            return context.get_dummy_value()

        size = types.uint64
        return types.void(bodies, size, records, size, moves, motion, size, size), generate

    return type_and_generate


_scatter_four_lanes: Any = intrinsic(_scatter_four(spares_idle=False))
_scatter_four_lanes_of_movable_balls: Any = intrinsic(_scatter_four(spares_idle=True))


@njit(cache=True, inline="always")
def scatter_moves(bodies, pair, records, masses, moves, motion):  # type: ignore[no-untyped-def]
    """Update v and τ of the balls of a batch by P and n × P (``moves``).

    The inverse masses of both balls begin at ``masses`` of ``records``. They are zero for the idle ball.
    """
    for group in range(uint64(LANES // VECTOR)):
        _scatter_four_lanes(bodies, pair, records, masses, moves, motion, uint64(0), uint64(VECTOR) * group)


@njit(cache=True, inline="always")
def scatter_moves_of_movable_balls(bodies, pair, records, masses, moves, motion):  # type: ignore[no-untyped-def]
    """Do the same as ``scatter_moves``, without writing to the idle ball, which comes last."""
    idle = uint64(len(motion) - BALL_LENGTH)
    for group in range(uint64(LANES // VECTOR)):
        _scatter_four_lanes_of_movable_balls(bodies, pair, records, masses, moves, motion, idle, uint64(VECTOR) * group)
