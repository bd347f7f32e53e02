# mypy: ignore-errors
"""Warp kernels for sweeps over the factors, for contacts of at most two bodies, with one thread per contact or body.

They perform the operations of the kernels of ``sweeps.factors`` in double precision, with v = W̃ Λ. Each number is
written by one thread, which adds the changes of a body's contacts in a fixed order. Results on a device are therefore
bitwise reproducible.
"""

import warp as wp

wp.config.log_level = wp.LOG_ERROR
wp.set_module_options({"enable_backward": False})

Number = wp.float64
Numbers = wp.array(dtype=wp.float64)
Indices = wp.array(dtype=wp.int32)


@wp.struct
class Contacts:
    """The constant data of all contacts.

    Attributes:
        length: degrees of freedom of a body.
        idle: index of the idle body, which follows all others and replaces a missing body.
        bodies: two bodies of each contact.
        pieces: W̃ of each contact, six rows of ``length`` (N, T1 and T2 of the first body, then of the second).
        free_velocity: c, three entries for each contact.
        step_sizes: step sizes r of N and T of each contact.
        friction: μ of each contact.
        fixed_bound: fixed part a of the friction bound of each contact.
        coupling: G_T1N and G_T2N, by which ξ_T is corrected after a change of Λ_N; zero in Jacobi sweeps.
    """

    length: wp.int32
    idle: wp.int32
    bodies: wp.array(dtype=wp.int32)
    pieces: wp.array(dtype=wp.float64)
    free_velocity: wp.array(dtype=wp.float64)
    step_sizes: wp.array(dtype=wp.float64)
    friction: wp.array(dtype=wp.float64)
    fixed_bound: wp.array(dtype=wp.float64)
    coupling: wp.array(dtype=wp.float64)


@wp.func
def contact_velocity(contacts: Contacts, i: wp.int32, velocity: Numbers) -> wp.vec3d:
    """Return ξ of a contact from v."""
    n = contacts.free_velocity[3 * i]
    t1 = contacts.free_velocity[3 * i + 1]
    t2 = contacts.free_velocity[3 * i + 2]
    length = contacts.length
    for side in range(2):
        body = contacts.bodies[2 * i + side] * length
        offset = 3 * length * (2 * i + side)
        for x in range(length):
            v = velocity[body + x]
            n = n + contacts.pieces[offset + x] * v
            t1 = t1 + contacts.pieces[offset + length + x] * v
            t2 = t2 + contacts.pieces[offset + 2 * length + x] * v
    return wp.vec3d(n, t1, t2)


@wp.func
def update_impulse(contacts: Contacts, i: wp.int32, xi: wp.vec3d, impulses: Numbers) -> wp.vec3d:
    """Move Λ of a contact along −r ξ and project it; return its change."""
    old_n = impulses[3 * i]
    old_t1 = impulses[3 * i + 1]
    old_t2 = impulses[3 * i + 2]
    n = wp.max(old_n - contacts.step_sizes[2 * i] * xi[0], Number(0.0))
    dn = n - old_n
    r = contacts.step_sizes[2 * i + 1]
    t1 = old_t1 - r * (xi[1] + contacts.coupling[2 * i] * dn)
    t2 = old_t2 - r * (xi[2] + contacts.coupling[2 * i + 1] * dn)
    bound = contacts.fixed_bound[i] + contacts.friction[i] * n
    squared = t1 * t1 + t2 * t2
    scale = Number(1.0)
    if squared > bound * bound:
        scale = bound / wp.sqrt(squared)
    impulses[3 * i] = n
    impulses[3 * i + 1] = t1 * scale
    impulses[3 * i + 2] = t2 * scale
    return wp.vec3d(dn, t1 * scale - old_t1, t2 * scale - old_t2)


@wp.kernel
def update_colour(contacts: Contacts, order: Indices, first: wp.int32, impulses: Numbers, velocity: Numbers):
    """Update the contacts of one colour, which begins at ``first`` in the order, and v of their bodies."""
    i = order[first + wp.tid()]
    change = update_impulse(contacts, i, contact_velocity(contacts, i, velocity), impulses)
    length = contacts.length
    for side in range(2):
        body = contacts.bodies[2 * i + side]
        if body != contacts.idle:
            offset = 3 * length * (2 * i + side)
            for x in range(length):
                added = contacts.pieces[offset + x] * change[0] + contacts.pieces[offset + length + x] * change[1]
                added = added + contacts.pieces[offset + 2 * length + x] * change[2]
                velocity[body * length + x] = velocity[body * length + x] + added


@wp.kernel
def update_all(contacts: Contacts, impulses: Numbers, velocity: Numbers, changes: Numbers):
    """Update all contacts from the same v, and write the changes of Λ."""
    i = wp.tid()
    change = update_impulse(contacts, i, contact_velocity(contacts, i, velocity), impulses)
    for lane in range(3):
        changes[3 * i + lane] = change[lane]


@wp.kernel
def update_velocities(contacts: Contacts, starts: Indices, touching: Indices, changes: Numbers, velocity: Numbers):
    """Add the changes of the contacts of a body to its v; ``touching`` lists 2 · contact + side for each body."""
    body = wp.tid()
    length = contacts.length
    for p in range(starts[body], starts[body + 1]):
        offset = 3 * length * touching[p]
        k = 3 * (touching[p] // 2)
        for x in range(length):
            added = contacts.pieces[offset + x] * changes[k] + contacts.pieces[offset + length + x] * changes[k + 1]
            added = added + contacts.pieces[offset + 2 * length + x] * changes[k + 2]
            velocity[body * length + x] = velocity[body * length + x] + added


@wp.kernel
def write_relative_velocity(contacts: Contacts, velocity: Numbers, relative_velocity: Numbers):
    """Write ξ of all contacts."""
    i = wp.tid()
    xi = contact_velocity(contacts, i, velocity)
    for lane in range(3):
        relative_velocity[3 * i + lane] = xi[lane]
