"""Exchange of velocities between bodies and the lanes of a batch, by vector instructions.

A batch holds one quantity of all its contacts in adjacent lanes, while the velocity of a body is adjacent in memory.
Four lanes at a time are read as vectors of four numbers and transposed. numba does not combine scalar instructions into
vectors, so the functions here generate vector instructions of LLVM, which splits them for processors with shorter
vectors. They compute the same numbers as scalar instructions, to the last bit. If kernels run as Python
(``NUMBA_DISABLE_JIT=1``), loops over lanes replace them.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types, uint64
from numba.core import cgutils
from numba.extending import intrinsic

from ....problems.arrays import FloatArray

LANES = 16
"""Number of contacts in a batch, the smallest number for which compilers vectorise a loop of known length."""

VECTOR = 4
"""Number of lanes that are exchanged at a time."""

BALL_LENGTH = 8
"""Entries of a ball in an array of motions: v, 0, τ and 0, together 64 bytes, the cache line of most processors."""

VECTOR_TYPE = ir.VectorType(ir.DoubleType(), VECTOR)
"""Type of a vector in LLVM."""

CONTRACT = ("contract",)
"""Permission to round a product and a sum once, as ``fastmath={"contract"}`` gives to kernels."""


def zeros_for_balls(count: int) -> FloatArray:
    """Return zeros for ``count`` balls, flat, each at a multiple of 64 bytes."""
    zeros: FloatArray = _aligned_zeros(BALL_LENGTH * count)
    return zeros


def aligned_copy(numbers: FloatArray) -> FloatArray:
    """Return a copy that begins at a multiple of 64 bytes."""
    copy: FloatArray = _aligned_copy(numbers)
    return copy


@njit(cache=True)
def _aligned_zeros(length):  # type: ignore[no-untyped-def]
    numbers = _aligned(length)
    for k in range(len(numbers)):
        numbers[k] = 0.0
    return numbers


@njit(cache=True)
def _aligned_copy(numbers):  # type: ignore[no-untyped-def]
    copy = _aligned(len(numbers))
    for k in range(len(copy)):
        copy[k] = numbers[k]
    return copy


@njit(cache=True)
def _aligned(length):  # type: ignore[no-untyped-def]
    """Return an array of any numbers that begins at a multiple of 64 bytes."""
    numbers = np.empty(length + BALL_LENGTH)
    first = (BALL_LENGTH - numbers.ctypes.data // 8 % BALL_LENGTH) % BALL_LENGTH
    return numbers[first : first + length]


class Instructions:
    """Generator of instructions on arrays, each of which is a pair of its type and its value in LLVM.

    Args:
        context: the context of the compilation.
        builder: appends instructions.
    """

    def __init__(self, context: Any, builder: Any) -> None:
        self._context, self.builder = context, builder

    def constant(self, number: int) -> Any:
        """Return an unsigned number."""
        return self._context.get_constant(types.uint64, number)

    def plus(self, index: Any, offset: int) -> Any:
        """Return an index plus a known number."""
        return self.builder.add(index, self.constant(offset))

    def load(self, array: tuple[Any, Any], index: Any, to_type: Any) -> Any:
        """Load and convert one entry."""
        value = self.builder.load(self._pointer(array, index))
        return self._context.cast(self.builder, value, array[0].dtype, to_type)

    def load_four(self, array: tuple[Any, Any], index: Any) -> Any:
        """Load four successive numbers."""
        numbers = self.builder.load(self._pointer_to_four(array, index))
        numbers.align = 8
        return numbers

    def store_four(self, numbers: Any, array: tuple[Any, Any], index: Any) -> None:
        """Store four successive numbers."""
        self.builder.store(numbers, self._pointer_to_four(array, index)).align = 8

    def transpose(self, rows: Sequence[Any]) -> list[Any]:
        """Return the columns of four vectors; missing rows are zero."""
        rows = [*rows, *[ir.Constant(VECTOR_TYPE, [0.0] * VECTOR)] * (VECTOR - len(rows))]
        even = [self._shuffle(*pair, 0, 4, 2, 6) for pair in (rows[:2], rows[2:])]
        odd = [self._shuffle(*pair, 1, 5, 3, 7) for pair in (rows[:2], rows[2:])]
        return [self._shuffle(*pair, *half) for half in ((0, 1, 4, 5), (2, 3, 6, 7)) for pair in (even, odd)]

    def store_lane(self, numbers: Any, lane: int, array: tuple[Any, Any], index: Any) -> None:
        """Store one number of a vector."""
        number = self.builder.extract_element(numbers, ir.Constant(ir.IntType(32), lane))
        self.builder.store(number, self._pointer(array, index))

    def vector(self, numbers: Sequence[Any]) -> Any:
        """Return a vector of four numbers."""
        vector = ir.Constant(VECTOR_TYPE, ir.Undefined)
        for lane, number in enumerate(numbers):
            vector = self.builder.insert_element(vector, number, ir.Constant(ir.IntType(32), lane))
        return vector

    def multiply(self, number: Any, numbers: Any) -> Any:
        """Return the product of a number and a vector."""
        return self.builder.fmul(self.vector([number] * VECTOR), numbers, flags=CONTRACT)

    def _pointer(self, array: tuple[Any, Any], index: Any) -> Any:
        array_type, value = array
        struct = self._context.make_array(array_type)(self._context, self.builder, value)
        return cgutils.get_item_pointer(  # type: ignore[no-untyped-call]
            self._context, self.builder, array_type, struct, [index], wraparound=False
        )

    def _pointer_to_four(self, array: tuple[Any, Any], index: Any) -> Any:
        return self.builder.bitcast(self._pointer(array, index), VECTOR_TYPE.as_pointer())

    def _shuffle(self, first: Any, second: Any, *order: int) -> Any:
        indices = ir.Constant(ir.VectorType(ir.IntType(32), VECTOR), list(order))
        return self.builder.shuffle_vector(first, second, indices)


def _gather_moves(typing_context, bodies, pair, motion, moves, lane):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        code = Instructions(context, builder)
        bodies, (_, pair), motion, moves, (_, lane) = zip(signature.args, arguments, strict=True)
        differences, sums = [], []
        for k in range(VECTOR):
            first = code.plus(builder.add(pair, lane), k)
            a, b = (code.load(bodies, index, types.uint64) for index in (first, code.plus(first, LANES)))
            differences.append(builder.fsub(code.load_four(motion, a), code.load_four(motion, b)))
            sums.append(builder.fadd(*(code.load_four(motion, code.plus(ball, VECTOR)) for ball in (a, b))))
        for k, row in enumerate(code.transpose(differences)[:3] + code.transpose(sums)[:3]):
            code.store_four(row, moves, code.plus(lane, LANES * k))
        return context.get_dummy_value()

    return types.void(bodies, types.uint64, motion, moves, types.uint64), generate


def _scatter_moves(skips_idle: bool) -> Callable[..., Any]:
    def type_and_generate(typing_context, bodies, pair, records, masses, moves, motion, lane, idle):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            code = Instructions(context, builder)
            operands = zip(signature.args, arguments, strict=True)
            bodies, (_, pair), records, (_, masses), moves, motion, (_, lane), (_, idle) = operands
            rows = [code.load_four(moves, code.plus(lane, LANES * k)) for k in range(6)]
            pushes, torques = code.transpose(rows[:3]), code.transpose(rows[3:])

            def move(ball: Any, mass: Any, k: int, combine: Any) -> None:
                """Add P/m to v of the first ball or subtract it from v of the second; subtract (n × P)/m from τ."""
                for index, change, add in (
                    (ball, pushes[k], combine),
                    (code.plus(ball, VECTOR), torques[k], builder.fsub),
                ):
                    product = code.multiply(mass, change)
                    code.store_four(add(code.load_four(motion, index), product, flags=CONTRACT), motion, index)

            for k in range(VECTOR):
                for first_lane, combine in ((k, builder.fadd), (LANES + k, builder.fsub)):
                    position = code.plus(lane, first_lane)
                    ball = code.load(bodies, builder.add(pair, position), types.uint64)
                    mass = code.load(records, builder.add(masses, position), types.float64)
                    if skips_idle:
                        with builder.if_then(builder.icmp_unsigned("!=", ball, idle)):
                            move(ball, mass, k, combine)
                    else:
                        move(ball, mass, k, combine)
            return context.get_dummy_value()

        index = types.uint64
        return types.void(bodies, index, records, index, moves, motion, index, index), generate

    return type_and_generate


def _gather_chunks(typing_context, axes, bodies, position, velocity, gathered, begin):  # type: ignore[no-untyped-def]
    length, offsets = len(axes), _offsets(len(axes))

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        code = Instructions(context, builder)
        _, bodies, (_, position), velocity, gathered, (_, begin) = zip(signature.args, arguments, strict=True)
        chunks = [code.load(bodies, code.plus(position, k), types.uint64) for k in range(VECTOR)]
        rows: dict[int, Any] = {}
        for offset in offsets:
            columns = code.transpose([code.load_four(velocity, code.plus(chunk, offset)) for chunk in chunks])
            rows |= {offset + k: column for k, column in enumerate(columns)}
        for axis in range(length) if not offsets else ():
            rows[axis] = code.vector([code.load(velocity, code.plus(chunk, axis), types.float64) for chunk in chunks])
        for axis in range(length):
            code.store_four(rows[axis], gathered, code.plus(begin, LANES * axis))
        return context.get_dummy_value()

    return types.void(axes, bodies, types.uint64, velocity, gathered, types.uint64), generate


def _scatter_chunks(skips_idle: bool) -> Callable[..., Any]:
    def type_and_generate(typing_context, axes, bodies, position, scattered, begin, velocity, idle):  # type: ignore[no-untyped-def]
        offsets = _offsets(len(axes))

        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            code = Instructions(context, builder)
            operands = zip(signature.args, arguments, strict=True)
            _, bodies, (_, position), scattered, (_, begin), velocity, (_, idle) = operands
            rows = [code.load_four(scattered, code.plus(begin, LANES * axis)) for axis in range(len(axes))]
            columns = [code.transpose(rows[offset : offset + VECTOR]) for offset in offsets]

            def write(chunk: Any, k: int) -> None:
                for offset, numbers in zip(offsets, columns, strict=True):
                    code.store_four(numbers[k], velocity, code.plus(chunk, offset))
                for axis, row in enumerate(rows) if not offsets else ():
                    code.store_lane(row, k, velocity, code.plus(chunk, axis))

            for k in range(VECTOR):
                chunk = code.load(bodies, code.plus(position, k), types.uint64)
                if skips_idle:
                    with builder.if_then(builder.icmp_unsigned("!=", chunk, idle)):
                        write(chunk, k)
                else:
                    write(chunk, k)
            return context.get_dummy_value()

        index = types.uint64
        return types.void(axes, bodies, index, scattered, index, velocity, index), generate

    return type_and_generate


def _offsets(length: int) -> tuple[int, ...]:
    """Return the entries of a chunk at which vectors begin, none if it is shorter; the last one may overlap another."""
    return (*range(0, length - VECTOR, VECTOR), length - VECTOR) if length >= VECTOR else ()


def _gather_moves_in_python(bodies, pair, motion, moves, lane):  # type: ignore[no-untyped-def]
    for k in range(int(lane), int(lane) + VECTOR):
        a, b = int(bodies[int(pair) + k]), int(bodies[int(pair) + LANES + k])
        for axis in range(3):
            moves[LANES * axis + k] = motion[a + axis] - motion[b + axis]
            moves[LANES * (axis + 3) + k] = motion[a + VECTOR + axis] + motion[b + VECTOR + axis]


def _scatter_moves_in_python(skips_idle: bool) -> Callable[..., Any]:
    def scatter(bodies, pair, records, masses, moves, motion, lane, idle):  # type: ignore[no-untyped-def]
        for k in range(int(lane), int(lane) + VECTOR):
            for position, sign in ((k, 1.0), (LANES + k, -1.0)):
                ball, mass = int(bodies[int(pair) + position]), float(records[int(masses) + position])
                for axis in range(3) if not (skips_idle and ball == idle) else ():
                    motion[ball + axis] += sign * mass * moves[LANES * axis + k]
                    motion[ball + VECTOR + axis] -= mass * moves[LANES * (axis + 3) + k]

    return scatter


def _gather_chunks_in_python(axes, bodies, position, velocity, gathered, begin):  # type: ignore[no-untyped-def]
    for k in range(VECTOR):
        chunk = int(bodies[int(position) + k])
        for axis in range(len(axes)):
            gathered[int(begin) + LANES * axis + k] = velocity[chunk + axis]


def _scatter_chunks_in_python(skips_idle: bool) -> Callable[..., Any]:
    def scatter(axes, bodies, position, scattered, begin, velocity, idle):  # type: ignore[no-untyped-def]
        for k in range(VECTOR):
            chunk = int(bodies[int(position) + k])
            for axis in range(len(axes)) if not (skips_idle and chunk == idle) else ():
                velocity[chunk + axis] = scattered[int(begin) + LANES * axis + k]

    return scatter


_IS_PYTHON = bool(getattr(config, "DISABLE_JIT", 0))

_gather_four_moves: Any = _gather_moves_in_python if _IS_PYTHON else intrinsic(_gather_moves)
_gather_four_chunks: Any = _gather_chunks_in_python if _IS_PYTHON else intrinsic(_gather_chunks)
_scatter_four_moves, _scatter_four_moves_but_idle = (
    _scatter_moves_in_python(skips_idle) if _IS_PYTHON else intrinsic(_scatter_moves(skips_idle))
    for skips_idle in (False, True)
)
_scatter_four_chunks, _scatter_four_chunks_but_idle = (
    _scatter_chunks_in_python(skips_idle) if _IS_PYTHON else intrinsic(_scatter_chunks(skips_idle))
    for skips_idle in (False, True)
)


@njit(cache=True, inline="always")
def gather_moves(bodies, pair, motion, moves):  # type: ignore[no-untyped-def]
    """Write v_i − v_j and τ_i + τ_j of a batch, whose balls begin at ``pair`` of ``bodies``, into ``moves``."""
    for group in range(uint64(LANES // VECTOR)):
        _gather_four_moves(bodies, pair, motion, moves, uint64(VECTOR) * group)


@njit(cache=True, inline="always")
def scatter_moves(bodies, pair, records, masses, moves, motion):  # type: ignore[no-untyped-def]
    """Update v and τ of the balls of a batch by P and n × P (``moves``).

    The inverse masses of both balls begin at ``masses`` of ``records``. They are zero for the idle ball.
    """
    for group in range(uint64(LANES // VECTOR)):
        _scatter_four_moves(bodies, pair, records, masses, moves, motion, uint64(VECTOR) * group, uint64(0))


@njit(cache=True, inline="always")
def scatter_moves_but_idle(bodies, pair, records, masses, moves, motion):  # type: ignore[no-untyped-def]
    """Do the same as ``scatter_moves``, without writing to the idle ball, which comes last."""
    idle = uint64(len(motion) - BALL_LENGTH)
    for group in range(uint64(LANES // VECTOR)):
        _scatter_four_moves_but_idle(bodies, pair, records, masses, moves, motion, uint64(VECTOR) * group, idle)


@njit(cache=True, inline="always")
def gather_chunks(axes, bodies, pair, velocity, gathered):  # type: ignore[no-untyped-def]
    """Copy v of the first and then of the second body of each contact of a batch into ``gathered``.

    The bodies begin at ``pair`` of ``bodies``, and the length of ``axes`` is that of a chunk.
    """
    for side in range(uint64(2)):
        for group in range(uint64(LANES // VECTOR)):
            first, begin = _first_lanes(axes, pair, side, group)
            _gather_four_chunks(axes, bodies, first, velocity, gathered, begin)


@njit(cache=True, inline="always")
def scatter_chunks(axes, bodies, pair, scattered, velocity):  # type: ignore[no-untyped-def]
    """Copy v of both bodies of each contact of a batch back; see ``gather_chunks``."""
    for side in range(uint64(2)):
        for group in range(uint64(LANES // VECTOR)):
            first, begin = _first_lanes(axes, pair, side, group)
            _scatter_four_chunks(axes, bodies, first, scattered, begin, velocity, uint64(0))


@njit(cache=True, inline="always")
def scatter_chunks_but_idle(axes, bodies, pair, scattered, velocity):  # type: ignore[no-untyped-def]
    """Do the same as ``scatter_chunks``, without writing to the idle chunk, which comes last."""
    idle = uint64(len(velocity) - len(axes))
    for side in range(uint64(2)):
        for group in range(uint64(LANES // VECTOR)):
            first, begin = _first_lanes(axes, pair, side, group)
            _scatter_four_chunks_but_idle(axes, bodies, first, scattered, begin, velocity, idle)


@njit(cache=True, inline="always")
def _first_lanes(axes, pair, side, group):  # type: ignore[no-untyped-def]
    """Return where a group of lanes begins in ``bodies`` and in the array of gathered velocities."""
    lane, lanes = uint64(VECTOR) * group, uint64(LANES)
    return pair + lanes * side + lane, lanes * uint64(len(axes)) * side + lane
