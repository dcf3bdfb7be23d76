"""Matrices and motions of structures whose members have mass, by other means."""

import numpy as np
from scipy.integrate import solve_ivp


def dense_mass(structure):
    """The mass matrix of one direction, typed from the integral over each member by two points of
    Gauss, which is exact for the square of a linear velocity."""
    whole = np.diag(np.array(structure.mass))
    points = 0.5 + np.array([-1, 1]) / np.sqrt(12)
    for (i, j), m in zip(structure.ends, structure.member_mass, strict=True):
        for s in points:
            shape = np.zeros(structure.nodes)
            shape[i], shape[j] = 1 - s, s
            whole += m / 2 * np.outer(shape, shape)
    return whole


def dense_tangent(structure):
    """The tangent stiffness by differences of the gradient through the complex plane."""
    x, size = structure.positions, structure.positions.size
    rows = []
    for k in range(size):
        z = x.ravel().astype(complex)
        z[k] += 1e-30j
        rows.append(-pulls(structure, z.reshape(x.shape)).imag.ravel() / 1e-30)
    return np.array(rows)


def pulls(structure, x):
    """Forces of the members on the nodes at positions x; slack strings have none."""
    i, j = structure.ends.T
    d = x[j] - x[i]
    length = np.sqrt(np.sum(d**2, axis=1))
    tension = structure.stiffnesses * (length - structure.natural_lengths)
    tension = np.where(structure.is_string & (tension.real < 0), 0, tension)
    each = (tension / length)[:, None] * d
    total = np.zeros(x.shape, dtype=each.dtype)
    np.add.at(total, i, each)
    np.add.at(total, j, -each)
    return total


def integrated(structure, u, v, t_end, held=(), extra=None, driven=None, dt_max=np.inf):
    """Final displacements and velocities by DOP853; `extra(t, u, v)` are more forces on the nodes,
    `driven` {node: (displacement, velocity, acceleration)} prescribes motions."""
    x, mass, driven = structure.positions, dense_mass(structure), driven or {}
    fixed = np.zeros(structure.nodes, dtype=bool)
    fixed[[*held, *driven]] = True
    free = ~fixed
    inner = mass[np.ix_(free, free)]

    def whole(t, y):
        u, v = np.zeros((2, *x.shape))
        u[free], v[free] = y.reshape(2, -1, x.shape[1])
        a = np.zeros_like(u)
        for node, motion in driven.items():
            u[node], v[node], a[node] = (f(t) for f in motion)
        return u, v, a

    def rates(t, y):
        u, v, a = whole(t, y)
        force = pulls(structure, x + u)
        if extra is not None:
            force = force + extra(t, u, v)
        force = (force - mass @ a)[free]
        return np.concatenate([v[free].ravel(), np.linalg.solve(inner, force).ravel()])

    y = np.concatenate([u[free].ravel(), v[free].ravel()])
    found = solve_ivp(rates, (0, t_end), y, "DOP853", rtol=1e-10, atol=1e-11, max_step=dt_max)
    return whole(t_end, found.y[:, -1])[:2]
