"""Lattices: plane lattices of springs, X modules, truncated octahedra, and a resonant lattice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.lattices.lattice import Lattice
from tensegrity.typing import Array, Length, NotNegative, Stiffness

HALF_ROOT = float(np.sqrt(0.75))
HEXAGONAL = np.array([[1.0, 0.0], [0.5, HALF_ROOT]])
TURNS = {  # rotations of the cube that lead from a node of an octahedron to its neighbours
    "square": np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "connecting": np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]]),
    "bar": np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]]),
}
TOUCH = 1e-9  # distance of nodes that are the same one, over the width of the cell


@checked
def square(
    side: Length = 1.0,
    k_bar: Stiffness = 100.0,
    k_diagonal: Stiffness = 50.0,
    mass: ArrayLike = 1.0,
) -> Lattice:
    """A plane square lattice of bars with both diagonals, without prestress.

    Parameters
    ----------
    side : float, optional
        [m].
    k_bar, k_diagonal : float, optional
        Spring constants of sides and diagonals [N/m]; isotropic where the latter is half the
        former.
    mass : array_like, optional
        Of each node [kg].

    Returns
    -------
    Lattice

    Examples
    --------
    >>> from tensegrity import catalogue, moduli
    >>> print(moduli(catalogue.square()).speeds([1, 0]).round(4))
    [ 7.0711 12.2474]
    """
    pairs = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, 1)), (0, 0, (1, -1))]
    k = [k_bar, k_bar, k_diagonal, k_diagonal]
    return Lattice([(0, 0)], side * np.eye(2), pairs, k_bar=k, mass=mass)


@checked
def triangular(side: Length = 1.0, k_bar: ArrayLike = 100.0, mass: ArrayLike = 1.0) -> Lattice:
    """A plane lattice of equilateral triangles of bars, without prestress.

    Parameters
    ----------
    side : float, optional
        [m].
    k_bar : array_like, optional
        Spring constant of each bar [N/m].
    mass : array_like, optional
        Of each node [kg].

    Returns
    -------
    Lattice
        Isotropic in its plane.
    """
    pairs = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, -1))]
    return Lattice([(0, 0)], side * HEXAGONAL, pairs, k_bar=k_bar, mass=mass)


@checked
def honeycomb(side: Length = 1.0, k_bar: ArrayLike = 100.0, mass: ArrayLike = 1.0) -> Lattice:
    """A plane lattice of hexagons of bars, which shear without resistance.

    Parameters
    ----------
    side : float, optional
        Of the hexagons [m].
    k_bar : array_like, optional
        Spring constant of each bar [N/m].
    mass : array_like, optional
        Of each node [kg].

    Returns
    -------
    Lattice
        The frequencies of one branch of its waves are 0.
    """
    pairs = [(0, 1), (1, 0, (0, 1)), (1, 0, (-1, 1))]
    vectors = np.sqrt(3) * side * HEXAGONAL
    return Lattice([(0, 0), (0, side)], vectors, pairs, k_bar=k_bar, mass=mass)


@checked
def kagome(side: Length = 1.0, k_bar: ArrayLike = 100.0, mass: ArrayLike = 1.0) -> Lattice:
    """A plane lattice of triangles of bars that share corners, around hexagons.

    Parameters
    ----------
    side : float, optional
        Of the triangles [m].
    k_bar : array_like, optional
        Spring constant of each bar [N/m].
    mass : array_like, optional
        Of each node [kg].

    Returns
    -------
    Lattice
        It has as many bars as degrees of freedom: the triangles rotate without resistance.
    """
    vectors = 2 * side * HEXAGONAL
    pairs = [(0, 1), (0, 2), (1, 2), (1, 0, (1, 0)), (2, 0, (0, 1)), (2, 1, (-1, 1))]
    return Lattice([(0, 0), vectors[0] / 2, vectors[1] / 2], vectors, pairs, k_bar=k_bar, mass=mass)


@checked
def x_strip(
    width: Length = 1.0,
    height: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: Stiffness = 100.0,
    k_string: Stiffness = 1.0,
    mass: ArrayLike = 1.0,
) -> Lattice:
    """A strip of Snelson's X modules that share their upright strings, in the plane.

    Parameters
    ----------
    width, height : float, optional
        Of a module [m].
    prestrain, k_bar, k_string, mass : optional
        Prestrain of the strings, >= 0; stiffness of bars and strings [N/m], shared ones being
        twice as stiff; masses as of `Lattice`.

    Returns
    -------
    Lattice

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> strip = catalogue.x_strip()
    >>> print(strip, bool(abs(strip.stress).max() < 1e-12))
    Lattice(2 nodes, 1 vector in 2 dimensions, 2 bars, 3 strings) True
    """
    q = k_string * prestrain / (1 + prestrain)
    strip = Lattice(
        [(0, 0), (0, height)], [(width, 0)], [(0, 1, 1), (1, 0, 1)],
        [(0, 0, 1), (1, 1, 1), (0, 1)], k_bar, k_string * np.array([1, 1, 2]), mass,
    )  # fmt: skip
    return strip.prestressed([-q, -q, q, q, 2 * q])


@checked
def x_plate(
    width: Length = 1.0,
    height: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: Stiffness = 100.0,
    k_string: Stiffness = 1.0,
    mass: ArrayLike = 1.0,
) -> Lattice:
    """A plate of Snelson's X modules that share all their strings, in the plane.

    Parameters
    ----------
    width, height : float, optional
        Of a module [m].
    prestrain, k_bar, k_string, mass : optional
        As of `x_strip`.

    Returns
    -------
    Lattice
        One node per cell; bars that cross are not joined.
    """
    vectors = np.diag([width, height])
    q = k_string * prestrain / (1 + prestrain)
    bars, strings = [(0, 0, (1, 1)), (0, 0, (1, -1))], [(0, 0, (1, 0)), (0, 0, (0, 1))]
    plate = Lattice([(0, 0)], vectors, bars, strings, k_bar, 2 * k_string, mass)
    return plate.prestressed([-q, -q, 2 * q, 2 * q])


@checked
def resonators(
    side: Length = 1.0,
    force_density: Annotated[float, ">= 0", "N/m"] = 0.1,
    k_bar: Stiffness = 100.0,
    k_diagonal: Stiffness = 100.0,
    k_string: Stiffness = 1.0,
    masses: Sequence[float] = (1.0, 1.0),
) -> Lattice:
    """A square frame of bars with a mass on four prestressed strings in each cell.

    Parameters
    ----------
    side : float, optional
        Of a cell [m].
    force_density : float, optional
        Of the strings [N/m], at least 0: that of the bars of the frame is opposite and equal.
    k_bar, k_diagonal, k_string : float, optional
        Stiffness of the sides and diagonals of the frame and of the strings [N/m].
    masses : sequence of 2 floats, optional
        Of the corner and of the centre, m0 and m1 [kg].

    Returns
    -------
    Lattice
        No plane wave has a frequency between w = sqrt(2 (k_string + force_density)/m1) and
        w sqrt(1 + m1/m0): the gap of the resonance, which the prestress tunes.
    """
    q = force_density
    m = check.vector("masses", masses, (2,))
    edges, across = [(1, 0), (0, 1)], [(1, 1), (1, -1)]
    strings = [(1, 0), (1, 0, (1, 0)), (1, 0, (0, 1)), (1, 0, (1, 1))]
    frame = Lattice(
        [(0, 0), (side / 2, side / 2)], side * np.eye(2),
        [(0, 0, o) for o in edges + across], strings,
        k_bar=[k_bar, k_bar, k_diagonal, k_diagonal], k_string=k_string, mass=m,
    )  # fmt: skip
    return frame.prestressed([-q, -q, 0, 0, q, q, q, q])


@checked
def octahedra(
    width: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: Stiffness = 100.0,
    k_string: Stiffness = 1.0,
    mass: ArrayLike = 1.0,
    layers: Annotated[int, ">= 0", "< 2"] = 0,
) -> Lattice:
    """Truncated octahedra of 24 strings in squares, 12 connecting ones and 12 bars.

    Neighbours are mirror images and share their squares, whose strings are twice as stiff.

    Parameters
    ----------
    width : float, optional
        Of one octahedron, from square to square [m].
    prestrain, k_bar, k_string, mass : optional
        Prestrain of all strings, >= 0; stiffness of bars and strings [N/m]; masses as of
        `Lattice`.
    layers : {0, 1}, optional
        0 fills space, 1 is a plate of one layer normal to z.

    Returns
    -------
    Lattice
        Free of macroscopic stress.  All strings of an octahedron have one force density q, its
        bars (sqrt(41) - 11)/10 q.  Bars come first, then strings, each with its image.

    Notes
    -----
    Defined here by symmetry: the nodes are images of one point under the 24 rotations of the
    cube.  Lattices of such cells were introduced by Pal, Ruzzene & Rimoli 2018, Tunable wave
    propagation by varying prestrain in tensegrity-based periodic media.

    Examples
    --------
    Shear waves along an axis are faster than longitudinal ones:

    >>> from tensegrity import catalogue, moduli
    >>> m = moduli(catalogue.octahedra())
    >>> m.speeds([1, 0, 0]).round(4).tolist(), bool(m.tangent[0, 0, 0, 0] < m.tangent[0, 1, 0, 1])
    ([0.1955, 0.2747, 0.2747], True)
    """
    q = k_string * prestrain / (1 + prestrain)
    point, beta = _octahedron()
    turns = [g.reshape(3, 3) for g in _rotations()]
    one = width * np.array([g @ point for g in turns])
    nodes = np.concatenate([one, one * [-1, 1, 1] + [width, 0, 0]])
    pairs = {name: _pairs(turns, turn) for name, turn in TURNS.items()}
    vectors = width * np.array([(1.0, 1, 0), (1, 0, 1), (0, 1, 1)])
    if layers:
        vectors = width * np.array([(1.0, 1, 0), (1, -1, 0)])
    first, images = _glued(nodes, vectors)
    bars, strings = (
        Counter(_member(images[i + start], images[j + start])
                for name in names for i, j in pairs[name] for start in (0, len(one)))
        for names in (["bar"], ["square", "connecting"])
    )  # fmt: skip
    shared = np.array([*bars.values(), *strings.values()])
    k = np.where(np.arange(len(shared)) < len(bars), k_bar, k_string) * shared
    lattice = Lattice(nodes[first], vectors, list(bars), list(strings),
                      k[: len(bars)], k[len(bars):], mass)  # fmt: skip
    return lattice.prestressed(q * shared * np.repeat([beta, 1.0], [len(bars), len(strings)]))


def _rotations() -> list[Array]:
    """The 24 rotations of the cube, flat."""
    group = {tuple(np.eye(3, dtype=int).ravel())}
    while True:
        more = {tuple((turn @ np.reshape(g, (3, 3))).ravel())
                for g in group for turn in TURNS.values()}  # fmt: skip
        if more <= group:
            return [np.array(g) for g in sorted(group)]
        group |= more


def _pairs(turns: Sequence[Array], turn: Array) -> list[tuple[int, int]]:
    """Nodes g v and g turn v of all rotations g, each pair once."""
    number = {tuple(g.ravel()): n for n, g in enumerate(turns)}
    each = {tuple(sorted((n, number[tuple((g @ turn).ravel())]))) for n, g in enumerate(turns)}
    return [(i, j) for i, j in sorted(each)]


def _octahedron() -> tuple[Array, float]:
    """A node v of an octahedron of width 1, and the force density of bars over that of strings.

    Equilibrium of v under its neighbours is (A + beta B) v = 0, an eigenvalue problem.
    """
    from scipy.linalg import eig

    one = np.eye(3)
    strings = TURNS["square"] + TURNS["square"].T + TURNS["connecting"] - 3 * one
    values, vectors = eig(strings, one - TURNS["bar"])
    nearest = int(np.abs(values).argmin())
    v = vectors[:, nearest].real
    return v / (2 * v[2]), float(values[nearest].real)


def _glued(nodes: Array, vectors: Array) -> tuple[list[int], list[tuple[int, Array]]]:
    """The nodes of one cell, and of each node the number in it and the offset of its cell."""
    first: list[int] = []
    images: list[tuple[int, Array]] = []
    inverse = np.linalg.pinv(vectors)
    for n, node in enumerate(nodes):
        away = node - nodes[first]
        offsets = np.rint(away @ inverse).astype(int)
        same = np.abs(away - offsets @ vectors).max(axis=1) < TOUCH * np.ptp(nodes)
        if same.any():
            images.append((int(same.argmax()), offsets[same.argmax()]))
        else:
            images.append((len(first), np.zeros(len(vectors), dtype=int)))
            first.append(n)
    return first, images


def _member(here: tuple[int, Array], there: tuple[int, Array]) -> Any:
    """A member between two nodes, the same whichever of its images is given."""
    (i, start), (j, end) = here, there
    offset = tuple(map(int, end - start))
    return min((i, j, offset), (j, i, tuple(-o for o in offset)))
