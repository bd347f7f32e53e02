"""Checks of the initial state of a motion of rigid bodies."""

from itertools import product

import numpy as np

from ....errors import ProblemError
from ...detection.coal_contacts import needs_coal, require_coal
from ...state import State
from .orientation import check_orientation
from .rigid_bodies import RigidBodies
from .round_shapes import Cylinder

MAX_START_DEPTH = 0.05
"""Largest initial penetration divided by the thickness of the thinner body."""


def check_start(bodies: RigidBodies, start: State) -> None:
    """Check that numbers are valid, joints close, bodies do not penetrate deeply, and the library coal is not missing.

    Raises:
        ProblemError: if coal is missing although contacts may need it, a vector has a wrong length or is not
            finite, a quaternion does not have unit length, a joint does not close or is beyond a limit, or a contact is
            deeper than ``MAX_START_DEPTH`` times the thickness of the thinner body. The message names the worst joint
            or contact.
    """
    _check_coal(bodies)
    for name, values, count in (("position", start.position, 7), ("velocity", start.velocity, 6)):
        shape = (count * bodies.n_bodies,)
        if np.shape(values) != shape:
            raise ProblemError(
                f"{name} at the start must have shape {shape}, {count} numbers per body, got {np.shape(values)}."
            )
        if not np.isfinite(values).all():
            body = int(np.flatnonzero(~np.isfinite(values))[0]) // count
            raise ProblemError(f"{name} of body {body} is not finite at the start; correct it.")
    poses = bodies.poses(start.position)
    for body, pose in enumerate(poses.tolist()):
        check_orientation(f"orientation of body {body} at the start", pose[3:])
    if bodies.joints is not None:
        bodies.joints.check_start(poses)
    contacts = bodies.contacts_within(poses, 0.0)
    depth = -contacts.gap / np.minimum(bodies.thicknesses[contacts.first], bodies.thicknesses[contacts.second])
    if depth.max(initial=0.0) > MAX_START_DEPTH:
        worst = int(depth.argmax())
        first, second = (
            f"fixed body {body - bodies.n_bodies}" if body >= bodies.n_bodies else f"body {body}"
            for body in (int(contacts.first[worst]), int(contacts.second[worst]))
        )
        raise ProblemError(
            f"{first} and {second} penetrate by {-contacts.gap[worst]:.3g} m at the start; move them apart to less "
            f"than {MAX_START_DEPTH:g} of the thickness of the thinner one."
        )


def _check_coal(bodies: RigidBodies) -> None:
    """Raise ``ProblemError`` if two bodies that may touch need coal and it is not installed."""
    shapes = [*bodies.shapes, *(body.shape for body in bodies.fixed)]
    joined = set() if bodies.joints is None else set(map(tuple, bodies.joints.pairs.tolist()))
    cylinders = [body for body, shape in enumerate(shapes) if isinstance(shape, Cylinder)]
    for cylinder, other in product(cylinders, range(len(shapes))):
        pair = min(cylinder, other), max(cylinder, other)
        if (
            cylinder != other
            and pair[0] < bodies.n_bodies
            and pair not in joined
            and needs_coal(shapes[cylinder], shapes[other])
        ):
            require_coal()
            return
