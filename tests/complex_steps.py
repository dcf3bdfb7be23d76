"""Runs in plain NumPy whose numbers may be complex: derivatives by a step off the real axis.

Nothing of the loops is used but the coefficients of the methods: tensions are differentiated from
energies here, distances are written out.
"""

import numpy as np
import sympy as sp
from oracle import split

TINY = 1e-40


def tension_of(energy, r, *symbols):
    """dV/dr in NumPy, of (r, parameters...)."""
    return sp.lambdify((r, *symbols), sp.diff(energy, r), "numpy")


def line(tension, parameters, inverse_mass):
    """Accelerations of a chain, of u (sites,); parameters (symbols, bonds)."""

    def acceleration(u):
        f = tension(u[1:] - u[:-1], *parameters)
        return inverse_mass * (np.append(f, 0) - np.append(0, f))

    return acceleration


def net(positions, bonds, lengths, tension, parameters, inverse_mass, walls=(), loads=0.0):
    """Accelerations of a network, of u (sites, dim); walls: (site, normal, gap, tension)."""
    first, second = np.transpose(bonds)

    def acceleration(u):
        x = positions + u
        apart = x[second] - x[first]
        distance = np.sqrt(np.sum(apart**2, axis=1))
        f = tension(distance - lengths, *parameters)
        pull = (f / distance)[:, None] * apart
        force = np.zeros(u.shape, dtype=complex) + loads
        np.add.at(force, first, pull)
        np.subtract.at(force, second, pull)
        for site, normal, gap, law in walls:
            force[site] -= law(gap + normal @ u[site]) * normal
        return inverse_mass[:, None] * force

    return acceleration


def run(acceleration, u, v, method, dt, steps):
    """u and v after every step; (steps + 1, ...) each."""
    found = [(u, v)]
    for _ in range(steps):
        u, v = split(method, dt, acceleration, u, v)
        found.append((u, v))
    return tuple(np.array(x) for x in zip(*found, strict=True))


def derivative(value, array, index):
    """d value(array)/d array[index], by a step along the imaginary axis."""
    moved = np.array(array, dtype=complex)
    moved[index] += 1j * TINY
    return np.imag(value(moved)) / TINY
