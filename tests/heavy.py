"""Structures whose bars have mass: published and derived numbers, and an independent integrator."""

import numpy as np
from scipy.integrate import solve_ivp

from tensegrity import Structure

# Of TsgFEM's tower, published to 11 digits: all members consistent, nodes 0 to 2 held [Hz].
TOWER_NODES = np.array([
    (10, 0, 0), (-5, 8.660254037844387, 0), (-5, -8.660254037844387, 0),
    (8.660254037844387, 5, 30), (-8.660254037844387, 5, 30), (0, -10, 30),
    (5, 8.660254037844387, 60), (-10, 0, 60), (5, -8.660254037844387, 60),
])  # fmt: skip
TOWER_BARS = [(0, 4), (1, 5), (2, 3), (4, 8), (5, 6), (3, 7)]
TOWER_STRINGS = [
    (3, 4), (4, 5), (5, 3), (6, 7), (7, 8), (8, 6),
    (0, 3), (1, 4), (2, 5), (3, 6), (4, 7), (5, 8),
]  # fmt: skip
TOWER_HZ = [
    0.010888669723670856, 0.019539454953775917, 0.03396454232465901, 0.03396454232466567,
    0.19559331016018464, 0.1955933101601994, 0.2752722622063401, 0.2752722622063637,
    0.2934010791770417, 0.34845697203876896, 0.3484569720387873, 0.41251363411172426,
    3.9142912332076105, 3.914291233207611, 3.9258744719270924, 8.610031002648665,
    8.610031002648668, 8.620964452912498,
]  # fmt: skip


def tower(**changed):
    """TsgFEM's tower of two stages with its sections and masses."""
    threes = (6, 3, 3, 6)
    ea = np.repeat([1.8276127564266516e10, 34816243.71535878, 17408121.857679367,
                    52996079.17587026], threes)  # fmt: skip
    natural = np.repeat([35.68219463340943, 17.29266860849596, 17.292668608495955,
                         30.394374737195296], threes)  # fmt: skip
    mass = np.repeat([1245433.649539911, 62.346717284978986, 31.17335864248945,
                      166.80405839915707], threes)  # fmt: skip
    given = {"bar_mass": mass[:6], "string_mass": mass[6:]} | changed
    return Structure(
        TOWER_NODES, TOWER_BARS, TOWER_STRINGS, k_bar=(ea / natural)[:6],
        k_string=(ea / natural)[6:], natural_lengths=natural, **given,
    )  # fmt: skip


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
