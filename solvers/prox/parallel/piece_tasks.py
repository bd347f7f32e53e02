"""Tasks of sweeps in several threads over pieces of W̃: batches of ``sweeps.batches.pieces``."""

from numba import njit, uint64

from ...sweeps.batches.lanes import LANES, gather_chunks, scatter_chunks_but_idle
from ...sweeps.batches.pieces import update_batch


@njit(cache=True, fastmath={"contract"}, error_model="numpy", inline="always")
def update_pieces(pieces, batch, scaled_velocity, impulses, change, beta, turn, v_before, v_after):  # type: ignore[no-untyped-def]
    """Update Λ (``impulses``) and v = W̃ Λ (``scaled_velocity``) of the contacts of a batch.

    ``pieces`` is as in ``batch_arguments``, and ``change``, ``beta`` and ``turn`` are as in ``update_batch``.
    ``v_before`` and ``v_after`` are work arrays for v of both bodies before and after the update.
    """
    axes, bodies, records = pieces
    lanes, length = uint64(LANES), uint64(len(axes))
    gather_chunks(axes, bodies, uint64(2 * LANES) * uint64(batch), scaled_velocity, v_before)
    begin = uint64(batch) * (uint64(6) * lanes * length + uint64(9) * lanes)
    update_batch(
        axes, records, begin, impulses, change, uint64(3) * lanes * uint64(batch), beta, turn, v_before, v_after
    )
    # the idle chunk remains zero, because all threads read it
    scatter_chunks_but_idle(axes, bodies, uint64(2 * LANES) * uint64(batch), v_after, scaled_velocity)


@njit(cache=True, fastmath={"contract"}, inline="always")
def write_piece_velocities(pieces, batch, scaled_velocity, v_before, velocity):  # type: ignore[no-untyped-def]
    """Write ξ of a batch in the order of Λ."""
    axes, bodies, records = pieces
    gather_chunks(axes, bodies, uint64(2 * LANES) * uint64(batch), scaled_velocity, v_before)
    _write_velocities(axes, records, batch, v_before, velocity)


@njit(cache=True, fastmath={"contract"}, inline="always")
def _write_velocities(axes, records, batch, v_before, velocity):  # type: ignore[no-untyped-def]
    """Write ξ = W̃ᵀ v + c of a batch in the order of Λ."""
    two, three, lanes, length = uint64(2), uint64(3), uint64(LANES), uint64(len(axes))
    row, first_entry = lanes * length, three * lanes * uint64(batch)
    begin = uint64(batch) * (uint64(6) * row + uint64(9) * lanes)
    for lane in range(lanes):
        a, c, n = begin + lane, begin + uint64(6) * row + lane, first_entry + lane
        b = a + three * row
        normal, first, second = records[c], records[c + lanes], records[c + two * lanes]
        for x in range(length):
            v_a, v_b = v_before[lanes * x + lane], v_before[lanes * (length + x) + lane]
            normal += records[a + lanes * x] * v_a + records[b + lanes * x] * v_b
            first += records[a + row + lanes * x] * v_a + records[b + row + lanes * x] * v_b
            second += records[a + two * row + lanes * x] * v_a + records[b + two * row + lanes * x] * v_b
        velocity[n], velocity[n + lanes], velocity[n + two * lanes] = normal, first, second
