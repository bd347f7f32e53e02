"""The merit of FCLIB and Siconos, contact by contact from its formula."""

import numpy as np


def onto_cone(point: np.ndarray, mu: float) -> np.ndarray:
    """Project (N, T1, T2) onto {‖T‖ ≤ μ N}."""
    normal, tangent = point[0], point[1:]
    length = np.linalg.norm(tangent)
    if length <= mu * normal:
        return point
    if mu * length <= -normal:
        return np.zeros(3)
    height = (normal + mu * length) / (1 + mu**2)
    return np.append(height, mu * height * tangent / length)


def natural_map(velocity: np.ndarray, impulses: np.ndarray, mu: np.ndarray) -> float:
    """Return ‖r − P_C(r − u − μ‖u_T‖ e_N)‖ over all contacts of three rows."""
    parts = []
    for k, coefficient in enumerate(mu):
        u, r = velocity[3 * k : 3 * k + 3], impulses[3 * k : 3 * k + 3]
        lifted = u + np.array([coefficient * np.linalg.norm(u[1:]), 0.0, 0.0])
        parts.append(r - onto_cone(r - lifted, coefficient))
    return float(np.linalg.norm(np.concatenate(parts)))
