"""One time step of rigid bodies: masses, velocities and contact points, as any physics engine can list them.

======================== ==================================================================================
``mass``                 m [kg], shape (n_bodies,)
``inertia``              [kg m²], shape (n_bodies, 3) about the principal axes, or (n_bodies, 3, 3) in world axes
``orientation``          unit quaternions x, y, z, w of the principal axes, shape (n_bodies, 4); optional
``position``             of the centres of mass [m], shape (n_bodies, 3)
``velocity``             of the centres of mass before the step [m/s], shape (n_bodies, 3)
``angular_velocity``     before the step, in world axes [rad/s], shape (n_bodies, 3)
``gravity``              [m/s²], shape (3,)
``time_step``            h [s]
``body_1``, ``body_2``   index of the two bodies of each contact, −1 for a fixed one, shape (n_contacts,)
``point``                contact points on body 2 [m], shape (n_contacts, 3)
``point_1``              contact points on body 1, if they differ; ``point`` if left out
``normal``               unit normals from body 1 to body 2, shape (n_contacts, 3)
``mu``                   friction coefficient, one number or shape (n_contacts,)
``restitution``          ε, one number or shape (n_contacts,); 0 if left out
``distance``             gap [m], negative for penetration, shape (n_contacts,); 0 if left out
``tangent``              first tangent, shape (n_contacts, 3); chosen freely if left out
``impulses``             Λ_N, Λ_T1, Λ_T2 of the engine, on body 2 [N s], shape (n_contacts, 3); optional, for the judge
``version``              1; optional
======================== ==================================================================================

For velocities v of the bodies, Wᵀ v is the velocity of the contact points on body 2 relative to those on body 1. With
u before the step, u_f = u + h g, the velocity without contacts, and γ = Wᵀ u,

    c_N = (Wᵀ u_f)_N + ε min(γ_N, 0) + max(gap, 0)/h,        c_T = (Wᵀ u_f)_T,

so that Newton's impact law applies to approaching contacts, and an open contact may close within the step
(Moreau 1988; Stewart & Trinkle 1996). Penetration is not corrected. Include the effect of other torques, such as the
gyroscopic one, in ``angular_velocity``.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...arrays import FloatArray, IntArray
from ...contact.matrices.factors import InverseMass
from ...contact.problem import FREE_FALL, ContactProblem
from ...errors import ProblemError, suggestion
from ..repair import Repair
from ..stored_solution import with_stored_solution
from .plain import Arrays, check_version, stored_impulses

VERSION = 1
"""Newest version of the names in the module docstring."""

NEEDED = ("mass", "inertia", "position", "velocity", "angular_velocity", "gravity", "time_step")
"""Names of required arrays of bodies."""

OF_CONTACTS = ("body_1", "body_2", "point", "normal", "mu")
"""Names of required arrays of contacts."""

OPTIONAL = ("orientation", "point_1", "restitution", "distance", "tangent", "impulses", "version")
"""Names of optional arrays."""

KNOWN = (*NEEDED, *OF_CONTACTS, *OPTIONAL)
"""Names of all arrays that a file may have."""

UNIT = 1e-3
"""Tolerated deviation of the length of a normal or a quaternion from 1; engines work in single precision."""


def recognises(arrays: Arrays) -> bool:
    """Return whether an array has the name body_1, or two have the names mass and inertia."""
    return "body_1" in arrays or {"mass", "inertia"} <= arrays.keys()


def problem_of_arrays(arrays: Arrays, repair: Repair) -> ContactProblem:
    """Return the problem of the step.

    Args:
        arrays: as in the module docstring.
        repair: how an inertia tensor that is not symmetric is read.

    Raises:
        ProblemError: if an array is missing, unknown, or does not match the others, or a mass is not positive.
    """
    _check_names(arrays)
    check_version(arrays, VERSION)
    n = arrays["mass"].size
    first, second = (_bodies(arrays, name, n) for name in ("body_1", "body_2"))
    _check_pairs(first, second)
    count = len(first)
    step, gravity = _positive(arrays, "time_step"), _numbers(arrays, "gravity", (3,))
    velocity = np.hstack([_numbers(arrays, name, (n, 3)) for name in ("velocity", "angular_velocity")]).ravel()
    directions = _directions(arrays, first, second, n)
    free_motion = velocity + np.tile(np.append(step * gravity, np.zeros(3)), n)
    approach = directions.T @ velocity
    c = directions.T @ free_motion
    c[::3] += _per_contact(arrays, "restitution", count) * np.minimum(approach[::3], 0.0)
    c[::3] += np.maximum(_per_contact(arrays, "distance", count), 0.0) / step
    mass, notes = repair.mass(_mass(arrays, n))
    provenance = {"source": "rigid bodies", "time_step": step, FREE_FALL: float(step * np.linalg.norm(gravity))}
    problem = ContactProblem.from_factors(
        directions,
        InverseMass.of_mass(mass),
        c,
        _per_contact(arrays, "mu", count),
        free_motion=free_motion,
        provenance=provenance | notes,
    )
    if "impulses" not in arrays:
        return problem
    return with_stored_solution(problem, stored_impulses(arrays["impulses"], 3 * count))


def _check_names(arrays: Arrays) -> None:
    for key in arrays:
        if key not in KNOWN:
            raise ProblemError(f"there is an unknown array {key!r}{suggestion(key, KNOWN)}")
    missing = [name for name in (*NEEDED, *OF_CONTACTS) if name not in arrays]
    if missing:
        raise ProblemError(f"there is no array {missing[0]!r}; add it to the masses, velocities and contacts.")


def _check_pairs(first: IntArray, second: IntArray) -> None:
    is_same_body = (first == second) & (first >= 0)
    if is_same_body.any():
        contact = int(np.argmax(is_same_body))
        raise ProblemError(
            f"contact {contact} has body {first[contact]} on both sides; 'body_1' and 'body_2' must differ."
        )


def _directions(arrays: Arrays, first: IntArray, second: IntArray, n_bodies: int) -> sp.csc_array[Any]:
    """Return W: the generalised forces of unit impulses along N, T1, T2, shape (6 n_bodies, 3 n_contacts)."""
    count = len(first)
    normal = _unit(_numbers(arrays, "normal", (count, 3)), "normal")
    if "tangent" in arrays:
        tangent = _numbers(arrays, "tangent", (count, 3))
        tangent = tangent - (tangent * normal).sum(axis=1, keepdims=True) * normal
        tangent = _unit(tangent, "tangent")
    else:
        axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
        tangent = np.cross(normal, axis)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    axes = np.stack([normal, tangent, np.cross(normal, tangent)], axis=1)  # (count, 3 rows, 3 coordinates)
    position = _numbers(arrays, "position", (n_bodies, 3))
    point_on_second = _numbers(arrays, "point", (count, 3))
    point_on_first = _numbers(arrays, "point_1", (count, 3)) if "point_1" in arrays else point_on_second
    blocks = []
    for body, sign, point in ((second, 1.0, point_on_second), (first, -1.0, point_on_first)):
        contacts = np.flatnonzero(body >= 0)
        lever = (point[contacts] - position[body[contacts]])[:, None, :]
        forces = axes[contacts]
        values = sign * np.concatenate([forces, np.cross(lever, forces)], axis=2)  # (contacts, 3 rows, 6 dofs)
        rows = np.broadcast_to((6 * body[contacts])[:, None, None] + np.arange(6), values.shape)
        columns = np.broadcast_to((3 * contacts)[:, None, None] + np.arange(3)[:, None], values.shape)
        blocks.append((values.ravel(), rows.ravel(), columns.ravel()))
    values, rows, columns = (np.concatenate(part) for part in zip(*blocks, strict=True))
    return sp.csc_array(sp.coo_array((values, (rows, columns)), shape=(6 * n_bodies, 3 * count)))


def _mass(arrays: Arrays, n_bodies: int) -> sp.csr_array[Any]:
    """Return M, blocks of m and of the inertia in world axes, shape (6 n_bodies, 6 n_bodies)."""
    mass = _numbers(arrays, "mass", (n_bodies,))
    if not (mass > 0.0).all():
        body = int(np.argmin(mass > 0.0))
        raise ProblemError(
            f"mass[{body}] = {mass[body]} must be positive; for a fixed body, set 'body_1' or 'body_2' to −1."
        )
    inertia = arrays["inertia"]
    if inertia.ndim == 2:
        principal = _numbers(arrays, "inertia", (n_bodies, 3))
        axes = np.broadcast_to(np.eye(3), (n_bodies, 3, 3))
        if "orientation" in arrays:
            axes = _rotations(_numbers(arrays, "orientation", (n_bodies, 4)))
        tensors = np.einsum("bij,bj,bkj->bik", axes, principal, axes)
        tensors = 0.5 * (tensors + tensors.transpose(0, 2, 1))
    else:
        tensors = _numbers(arrays, "inertia", (n_bodies, 3, 3))
    blocks = [block for m, tensor in zip(mass, tensors, strict=True) for block in (m * np.eye(3), tensor)]
    return sp.csr_array(sp.block_diag(blocks, format="csr"))


def _rotations(quaternions: FloatArray) -> FloatArray:
    """Return rotation matrices, shape (n, 3, 3), of unit quaternions x, y, z, w."""
    from scipy.spatial.transform import Rotation  # import takes 0.1 s

    matrices: FloatArray = Rotation.from_quat(_unit(quaternions, "orientation")).as_matrix()
    return matrices


def _unit(vectors: FloatArray, name: str) -> FloatArray:
    """Return vectors of length 1; raise ``ProblemError`` if one is not a unit vector, or a tangent is too short."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    wrong = np.abs(length - 1.0) > UNIT if name != "tangent" else ~(length > UNIT)
    if wrong.any():
        index = int(np.argmax(wrong))
        raise ProblemError(f"{name}[{index}] = {vectors[index]} must be a unit vector.")
    units: FloatArray = vectors / length
    return units


def _bodies(arrays: Arrays, name: str, n_bodies: int) -> IntArray:
    bodies: NDArray[Any] = arrays[name]
    if bodies.ndim != 1 or (bodies.size and bodies.dtype.kind not in "iu"):
        raise ProblemError(f"{name!r} must be a vector of whole numbers, one per contact.")
    if ((bodies < -1) | (bodies >= n_bodies)).any():
        contact = int(np.argmax((bodies < -1) | (bodies >= n_bodies)))
        raise ProblemError(
            f"{name}[{contact}] = {bodies[contact]} must be a body from 0 to {n_bodies - 1}, or -1 for a fixed one."
        )
    return bodies.astype(np.int64)


def _per_contact(arrays: Arrays, name: str, count: int) -> FloatArray:
    if name not in arrays:
        return np.zeros(count)
    return np.full(count, _numbers(arrays, name, ())) if arrays[name].ndim == 0 else _numbers(arrays, name, (count,))


def _positive(arrays: Arrays, name: str) -> float:
    value = float(_numbers(arrays, name, ()))
    if not value > 0.0:
        raise ProblemError(f"{name!r} = {value} must be positive.")
    return value


def _numbers(arrays: Arrays, name: str, shape: tuple[int, ...]) -> FloatArray:
    """Return an array of finite numbers, and check its shape."""
    values = arrays[name]
    if values.shape != shape or (values.size and values.dtype.kind not in "fiu"):
        raise ProblemError(f"{name!r} must be numbers of shape {shape}, got shape {values.shape}.")
    if not np.isfinite(values).all():
        raise ProblemError(f"{name!r} must be finite.")
    return values.astype(np.float64)
