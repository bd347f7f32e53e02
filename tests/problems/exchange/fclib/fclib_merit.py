"""The merit function of FCLIB and Siconos, evaluated contact by contact from its formula."""

from itertools import product

import numpy as np


def onto_cone(point: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    """Return the nearest point of {‖x_k‖ ≤ μ_k N} to (N, x_1, …), with one x_k of two rows for each μ_k.

    Of the nearest points on each face of the cone, this is the nearest one that lies in the cone.
    """
    normal, parts = point[0], [point[1 + 2 * k : 3 + 2 * k] for k in range(len(coefficients))]
    lengths = [float(np.linalg.norm(part)) for part in parts]
    candidates = [np.zeros(len(point))]
    for bound in product([False, True], repeat=len(parts)):
        active = [k for k in range(len(parts)) if bound[k]]
        above = normal + sum(coefficients[k] * lengths[k] for k in active)
        height = above / (1.0 + sum(coefficients[k] ** 2 for k in active))
        held = [
            coefficients[k] * height * parts[k] / lengths[k] if bound[k] and lengths[k] else parts[k]
            for k in range(len(parts))
        ]
        is_inside = all(bound[k] or lengths[k] <= coefficients[k] * height for k in range(len(parts)))
        if height >= 0.0 and is_inside:
            candidates.append(np.concatenate([[height], *held]))
    return min(candidates, key=lambda candidate: float(np.linalg.norm(candidate - point)))


def natural_map(velocity: np.ndarray, impulses: np.ndarray, *friction: np.ndarray) -> float:
    """Return ‖r − P_C(r − u − Σ μ_k‖u_k‖ e_N)‖ over all contacts: N, two sliding rows and, with μ_r, two rolling ones.

    Args:
        velocity: u, shape (n_rows,).
        impulses: r, shape (n_rows,).
        friction: μ, and μ_r if there is rolling friction, each of shape (n_contacts,).
    """
    rows, parts = 1 + 2 * len(friction), []
    for contact, coefficients in enumerate(zip(*friction, strict=True)):
        u, r = (vector[rows * contact : rows * (contact + 1)] for vector in (velocity, impulses))
        lifted = u.copy()
        lifted[0] += sum(mu * np.linalg.norm(u[1 + 2 * k : 3 + 2 * k]) for k, mu in enumerate(coefficients))
        parts.append(r - onto_cone(r - lifted, coefficients))
    return float(np.linalg.norm(np.concatenate(parts)))
