"""Steps of any method in plain NumPy, for scenes that run without a compiled loop."""

from __future__ import annotations

import numpy as np

from tensegrity.methods import Splitting


def advance(acceleration, u, v, method, dt, steps, moving):
    """Advance u and v in place.

    Parameters
    ----------
    acceleration : callable u -> a
    u, v : ndarray
    method : Method
    dt : float
        [s]
    steps : int
    moving : int
        Rows of u that are sites.

    Returns
    -------
    float
        Bound on how far any coordinate of a site moved [m].
    """
    step = _split if isinstance(method, Splitting) else _nystrom
    return sum(step(acceleration, u, v, method, dt, moving) for _ in range(steps))


def _split(acceleration, u, v, method, dt, moving):
    travel = 0.0
    for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
        if kick:
            v += kick * dt * acceleration(u)
        move = drift * dt * v
        u += move
        travel += np.max(np.abs(move[:moving]))
    return travel


def _nystrom(acceleration, u, v, method, dt, moving):
    slopes = np.zeros((method.stages, *u.shape))
    for s, (node, row) in enumerate(zip(method.nodes, method.matrix, strict=True)):
        slopes[s] = acceleration(u + node * dt * v + dt**2 * np.tensordot(row, slopes, 1))
    move = dt * v + dt**2 * np.tensordot(method.positions, slopes, 1)
    u += move
    v += dt * np.tensordot(method.velocities, slopes, 1)
    return np.max(np.abs(move[:moving]))
