"""Steps of explicit methods in plain NumPy, which the compiled loops are held against.

Forces are those that a scene tells of itself, which `test_one_engine` holds against its energy.
The rows of the methods are typed from their sources: Blanes & Moan (2002), SRKN 11b.
"""

from typing import NamedTuple

import numpy as np

ORDERS = {"verlet": 2, "rkn6": 6, "rk4": 4, "midpoint": 2}
LIMITS = {"verlet": 2.0, "rkn6": 3.141431, "rk4": 2.828427}  # of stability: step times frequency
A = (0.041464998518262400, 0.198128671918067, -0.0400061921041533, 0.0752539843015807,
     -0.0115113874206879)  # fmt: skip
B = 0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928
LAST_A, LAST_B = 0.5 - sum(A), 1 - 2 * sum(B)
ROWS = {  # kicks and drifts
    "verlet": ((0.5, 0.5), (1.0,)),
    "rkn6": ((*A, LAST_A, LAST_A, *A[::-1]), (*B, LAST_B, *B[::-1])),
}
MATRIX = (), (0.5,), (0, 0.5), (0, 0, 1)  # of the classical rk4
WEIGHTS = np.array([1, 2, 2, 1]) / 6


class Stepped(NamedTuple):
    """Displacements and velocities after some steps, behind the sites those of walls: impulses.

    Attributes
    ----------
    u, v : ndarray, (sites + walls[, dim])
    met : ndarray, (springs, 2)
        Smallest and largest elongation of each kind of spring between sites, in the order of the
        bonds, at which forces were asked for, 0 included [m].
    """

    u: np.ndarray
    v: np.ndarray
    elongation_range: np.ndarray


def stepped(scene, state, method, dt, steps):
    """A chain or a network after some steps of "verlet", "rkn6" or "rk4"."""
    kinds = list(dict.fromkeys(scene.springs[: len(scene.elongation(state.u))]))
    group = np.array([kinds.index(s) for s in scene.springs[: len(scene.elongation(state.u))]])
    walls, seen = np.zeros((len(getattr(scene, "walls", ())), *state.u.shape[1:])), []
    u, v = np.concatenate([state.u, walls]), np.concatenate([state.v, walls])
    mass = np.reshape(scene.mass, (-1, *[1] * (u.ndim - 1)))

    def acceleration(u):
        u = u[: scene.sites]
        seen.append(scene.elongation(u))
        push = np.zeros_like(walls)
        if len(walls):
            for (_, wall), load in zip(scene.wall_contacts, scene.wall_load(u), strict=True):
                push[wall] -= load * scene.walls[wall].normal
        return np.concatenate([scene.forces(u) / mass, push])

    step = runge_kutta if method == "rk4" else split
    for _ in range(steps):
        u, v = step(method, dt, acceleration, u, v)
    r = [np.array(seen)[:, group == kind] for kind in range(len(kinds))]
    return Stepped(u, v, np.array([(min(x.min(), 0), max(x.max(), 0)) for x in r]))


def split(method, dt, acceleration, u, v):
    """Kicks and drifts in turn."""
    kicks, drifts = ROWS[method]
    for kick, drift in zip(kicks, (*drifts, 0.0), strict=True):
        v = v + dt * kick * acceleration(u)
        u = u + dt * drift * v
    return u, v


def runge_kutta(method, dt, acceleration, u, v):
    """Slopes of u and v at places made of those before."""
    slopes = []
    for row in MATRIX:
        inner = [sum(a * s[k] for a, s in zip(row, slopes, strict=False)) for k in (0, 1)]
        slopes.append((v + dt * inner[1], acceleration(u + dt * inner[0])))
    return tuple(x + dt * np.tensordot(WEIGHTS, s, 1) for x, s in
                 zip((u, v), np.moveaxis(np.array(slopes), 1, 0), strict=True))  # fmt: skip
