"""Orbits of members, the self-stress that they allow, and the prestress of a given prestrain.

With one force density for each orbit the equilibrium of all nodes is that of one node of each
orbit of nodes; its matrix is the equilibrium matrix, columns of an orbit added up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tensegrity.errors import EquilibriumError
from tensegrity.structures.statics import equilibrium_matrix
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array

ZERO = 1e-10  # of the largest singular value, or of a length: round-off
Orbit = list[tuple[int, int]]


def orbit_matrix(nodes: Array, orbits: Sequence[Orbit]) -> Array:
    """The equilibrium matrix [m] for one force density per orbit, (nodes, dim, orbits)."""
    ends = np.array([pair for orbit in orbits for pair in orbit])
    starts = np.cumsum([0, *map(len, orbits[:-1])])
    matrix = np.add.reduceat(equilibrium_matrix(nodes, ends), starts, axis=1)
    return matrix.reshape(*nodes.shape, len(orbits))


def first_root(function: Callable[[float], float], grid: Array) -> float | None:
    """The lowest root at which a function changes its sign between points of a grid."""
    from scipy.optimize import brentq

    values = np.array([function(float(x)) for x in grid])
    changes = np.flatnonzero(values[1:] * values[:-1] <= 0)
    if not changes.size:
        return None
    return float(brentq(function, grid[changes[0]], grid[changes[0] + 1], xtol=1e-15))


def prestressed(
    nodes: Array,
    bars: Sequence[Orbit],
    strings: Sequence[Orbit],
    prestrain: float,
    k_bar: ArrayLike,
    k_string: ArrayLike,
    mass: ArrayLike,
) -> Structure:
    """A structure of orbits of members, in the one state of self-stress that they allow.

    Parameters
    ----------
    nodes : ndarray, (nodes, dim)
        Positions in equilibrium [m].
    bars, strings : sequence of orbits
        Each orbit is a sequence of pairs of nodes, the members of which have one force density.
    prestrain : float
        Largest prestrain of a string, >= 0.
    k_bar, k_string, mass : array_like
        Stiffnesses [N/m] and masses [kg], as of `Structure`.

    Returns
    -------
    Structure

    Raises
    ------
    EquilibriumError
        No state of self-stress, more than one, or one in which a string is in compression.
    """
    from scipy.linalg import null_space

    orbits = [orbit for orbit in (*bars, *strings) if orbit]
    pairs = [[pair for orbit in part for pair in orbit] for part in (bars, strings)]
    s = Structure(nodes, pairs[0], pairs[1], k_bar, k_string, mass)
    matrix = orbit_matrix(s.positions, orbits).reshape(-1, len(orbits))
    states = null_space(matrix, rcond=ZERO).T
    if len(states) != 1:
        raise EquilibriumError(f"{len(states)} states of self-stress with this symmetry, must be 1")
    q = np.repeat(-np.sign(states[0, 0]) * states[0], [len(orbit) for orbit in orbits])
    wrong = np.flatnonzero((q > ZERO * q.max()) != s.is_string)
    if wrong.size:
        raise EquilibriumError(
            f"no self-stress: the force density of {s.name_of(int(wrong[0]))} would be "
            f"{q[wrong[0]] / q.max():.3g} of the largest: bars must push, strings pull"
        )
    strain = prestrain / (1 + prestrain)  # elongation over length, where it is largest
    return s.prestressed(q * strain / (q / s.stiffnesses).max())
