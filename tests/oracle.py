"""Steps of explicit methods in plain NumPy, which the compiled loops are held against.

Forces are those that a scene tells of itself, which `test_one_engine` holds against its energy.
"""

from typing import NamedTuple

import numpy as np

from tensegrity.engine.methods import Nystrom
from tensegrity.scenes.dynamics import dynamics


class Stepped(NamedTuple):
    """Displacements and velocities after some steps, behind the sites those of walls: impulses.

    Attributes
    ----------
    u, v : ndarray, (sites + walls[, dim])
    met : ndarray, (springs, 2)
        Smallest and largest elongation of each spring at which forces were asked for [m].
    travel : float
        Sum of the largest moves of any coordinate of a site [m].
    """

    u: np.ndarray
    v: np.ndarray
    met: np.ndarray
    travel: float


def stepped(scene, state, method, dt, steps):
    """A chain or a network after some steps of a splitting without processor, or of Nystrom's."""
    walls, moves, seen = np.zeros((dynamics(scene).wall_count, *state.u.shape[1:])), [], []
    u, v = np.concatenate([state.u, walls]), np.concatenate([state.v, walls])
    mobility = dynamics(scene).inverse_mass.reshape(-1, *[1] * (u.ndim - 1))

    def acceleration(u):
        u = u[: scene.sites]
        seen.append(dynamics(scene).stretch(u))
        push = np.zeros_like(walls)
        if len(walls):
            for (_, wall), load in zip(scene.wall_contacts, scene.wall_load(u), strict=True):
                push[wall] -= load * scene.walls[wall].normal
        return np.concatenate([mobility * scene.forces(u), push])

    step = nystrom if isinstance(method, Nystrom) else split
    for _ in range(steps):
        u, v = step(method, dt, acceleration, u, v, moves)
    r, group = np.array(seen), dynamics(scene).springs.group
    each = [r[:, group == spring] for spring in range(len(dynamics(scene).springs))]
    met = np.array([(x.min(), x.max()) for x in each])
    return Stepped(u, v, met, sum(np.abs(move[: scene.sites]).max() for move in moves))


def split(method, dt, acceleration, u, v, moves=None):
    """Kicks and drifts in turn; lists the moves of u."""
    moves = [] if moves is None else moves
    for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
        if kick:
            v = v + dt * kick * acceleration(u)
        if drift:
            moves.append(dt * drift * v)
            u = u + moves[-1]
    return u, v


def nystrom(method, dt, acceleration, u, v, moves):
    """Slopes at places made of those before."""
    slopes = []
    for node, row in zip(method.nodes, method.matrix, strict=True):
        inner = sum(a * slope for a, slope in zip(row, slopes, strict=False))
        slopes.append(acceleration(u + node * dt * v + dt**2 * inner))
    moves.append(dt * v + dt**2 * np.tensordot(method.positions, slopes, 1))
    return u + moves[-1], v + dt * np.tensordot(method.velocities, slopes, 1)
