"""Tensegrities with the symmetry of a regular solid, or of rings of nodes about an axis.

In a solid each node is the image of one, and has one bar, to its image under half a turn, and
strings to those under two other rotations.  For given force densities of the strings it lies along
an eigenvector of a matrix of three rows, and the least force density of the bars belongs to it
(Connelly & Back 1998).  In towers and domes each ring is turned against the ring next to it.
With one force density for each orbit of members one node of each orbit is to be in equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError
from tensegrity.prisms.stack import polygon
from tensegrity.structures.statics import equilibrium_matrix
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array, Index, Length, NotNegative, Positive, Sides

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


SOLIDS = {  # corners of a face, faces at a corner
    "tetrahedron": (3, 3),
    "cube": (4, 3),
    "octahedron": (3, 4),
    "dodecahedron": (5, 3),
    "icosahedron": (3, 5),
}
PATTERNS = ("zigzag", "diamond")
WEIGHTS = np.array([-7.0, 7.0])  # logarithms of force densities over one another that are searched


@checked
def expandable_octahedron(
    strut: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Six bars in three parallel pairs and 24 strings of one length, also called icosahedron.

    Parameters
    ----------
    strut : float, optional
        Length of the bars [m].
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Bars along the axes, about the origin.  Parallel ones are half of their length from each
        other, strings are sqrt(3/8) of it (Tibert & Pellegrino 2003).  The shape of
        `geodesic("tetrahedron", "diamond")`, in another position.

    Examples
    --------
    >>> from tensegrity import catalogue, equilibrium_path, plates
    >>> ball = catalogue.expandable_octahedron(strut=4.0)
    >>> on_triangles = plates([0, 4, 8], [3, 7, 11], normal=(1, 1, 1))
    >>> path = equilibrium_path(ball, supports=on_triangles, max_shortening=0.9)
    >>> print(f"{path.events[0].shortening:.4f} m, {path.slack[-1].sum()} strings slack")
    0.8602 m, 3 strings slack
    """
    first = [(0, a, b) for a in (-0.25, 0.25) for b in (-0.5, 0.5)]
    nodes = np.array([np.roll(x, shift) for shift in range(3) for x in first])
    far = np.linalg.norm(nodes[:, None] - nodes, axis=2)
    bars, strings = (
        [(int(i), int(j)) for i, j in np.argwhere(np.triu(np.abs(far - length) < ZERO))]
        for length in (1.0, (3 / 8) ** 0.5)
    )
    return prestressed(strut * nodes, [bars], [strings], prestrain, k_bar, k_string, mass)


def truncated_tetrahedron(
    strut: float = 1.0,
    prestrain: float = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Six bars and 18 strings, twelve of them round four triangles, all of one length.

    Parameters
    ----------
    strut, prestrain, k_bar, k_string, mass : optional
        See `geodesic`.

    Returns
    -------
    Structure
        That of `geodesic("tetrahedron")`; bars are 2.2507 times as long as strings (Tibert &
        Pellegrino 2003).

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> s = catalogue.truncated_tetrahedron()
    >>> print(f"{s.lengths[0] / s.lengths[6]:.4f}, {s.lengths[0] / s.lengths[-1]:.4f}")
    2.2507, 2.2507
    """
    return geodesic("tetrahedron", "zigzag", strut, 1.0, prestrain, k_bar, k_string, mass)


@checked
def geodesic(
    solid: Annotated[str, SOLIDS] = "icosahedron",
    pattern: Annotated[str, PATTERNS] = "zigzag",
    strut: Length = 1.0,
    ratio: Positive = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """A geodesic tensegrity: as many bars as a regular solid has edges, in a net of strings.

    Parameters
    ----------
    solid : {"tetrahedron", "cube", "octahedron", "dodecahedron", "icosahedron"}, optional
        The solid whose rotations leave the structure invariant.
    pattern : {"zigzag", "diamond"}, optional
        "zigzag" is the truncated solid: a polygon of strings round each corner, a string on each
        edge; a bar joins the ends of three strings that make a Z.  "diamond" is the snub solid: a
        polygon of strings round each corner and in each face; a bar is the diagonal of a diamond
        of four strings.
    strut : float, optional
        Length of the bars [m].
    ratio : float, optional
        Length of the strings round corners over that of the others.
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        About the origin; nodes from the lowest up, which are those round a corner.  Strings round
        corners come first.

    Raises
    ------
    EquilibriumError
        If no self-stress was found that has this ratio.

    Notes
    -----
    Patterns: Pugh 1976, An Introduction to Tensegrity.  The sphere of 30 bars is that of the
    icosahedron or dodecahedron.

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> sphere = catalogue.geodesic("icosahedron")
    >>> print(sphere.bars, sphere.strings, f"{sphere.lengths[0] / sphere.lengths[-1]:.4f}")
    30 90 2.8025
    >>> catalogue.geodesic("cube", "diamond")
    Structure(24 nodes in 3 dimensions, 12 bars, 48 strings, 0 of them slack)
    """
    from scipy.linalg import eigh

    generators = _generators(solid, pattern)
    forces = [2 * np.eye(3) - g - g.T for g in generators]  # on the node, of unit force densities

    def node(weight: float) -> Array:
        """Where its forces balance, for bars of length 1, on the lower side."""
        place = eigh(forces[2], np.exp(weight) * forces[0] + forces[1])[1][:, -1]
        return -np.sign(place[2]) * place / np.linalg.norm(generators[2] @ place - place)

    def excess(weight: float) -> float:
        place = node(weight)
        first, second = (np.linalg.norm(g @ place - place) for g in generators[:2])
        return float(np.log(first / second) - np.log(ratio))

    weight = first_root(excess, WEIGHTS)
    if weight is None:
        low, high = sorted(np.exp(excess(end) + np.log(ratio)) for end in WEIGHTS)
        raise EquilibriumError(f"ratio {ratio:g} must be within {low:.3g} and {high:.3g}")
    group = [np.eye(3)]
    for one in group:
        for other in (one @ generator for generator in generators):
            if all(np.abs(other - known).max() > ZERO for known in group):
                group.append(other)
    turns, place = np.array(group), node(weight)
    turns = turns[np.argsort((turns @ place)[:, 2].round(9), kind="stable")]

    def orbit(generator: Array) -> Orbit:
        ends = np.einsum("iab,bc,jac->ij", turns, generator, turns).argmax(axis=1)
        return sorted({(min(i, j), max(i, j)) for i, j in enumerate(ends.tolist())})

    first, second, bars = map(orbit, generators)
    return prestressed(
        strut * turns @ place, [bars], [first, second], prestrain, k_bar, k_string, mass
    )


def _generators(solid: str, pattern: str) -> tuple[Array, Array, Array]:
    """Rotations from a node to others: by strings round a corner, by other strings, by the bar."""
    from scipy.spatial.transform import Rotation

    face, corner = SOLIDS[solid]
    cosine = np.cos(np.pi / face) / np.sin(np.pi / corner)  # between corner and edge (Coxeter)
    vectors = np.array([[0, 0, 2 / corner], [np.sqrt(1 - cosine**2), 0, cosine]])
    turn, half = Rotation.from_rotvec(np.pi * vectors).as_matrix()
    return (turn, half, turn @ half @ turn.T) if pattern == "zigzag" else (turn, turn @ half, half)


GRID = np.arange(1, 101) / 101  # overlaps at which the determinant of a tower is computed


@checked
def tower(
    stages: Annotated[int, ">= 2"] = 2,
    radius: Length = 1.0,
    height: Length = 1.3,
    twist: Annotated[float, f"> {5 * np.pi / 6}", f"< {np.pi}", "rad"] = 11 * np.pi / 12,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Snelson's tower: stages of three bars that overlap, each turned against the one below.

    Parameters
    ----------
    stages : int, optional
        At least 2.
    radius : float, optional
        Of the cylinder on which all nodes are [m].
    height : float, optional
        Of a stage, the rise of its bars [m].
    twist : float, optional
        Turn of a bar about the axis [rad], above 5 pi/6, the twist of a prism, and below pi.
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Triangles of nodes: feet and heads of the first stage, then of the second.  Bars stage by
        stage.  Strings: the lowest and the highest triangle; saddles, two orbits from stage to
        stage; a diagonal orbit in each stage; verticals, two orbits from stage to stage.  The
        overlap of stages is the least one at which a self-stress exists; over the height, it
        depends on the twist and on the number of stages alone.

    Raises
    ------
    EquilibriumError
        If no overlap admits a self-stress with all strings in tension.

    Notes
    -----
    The strings are those of Sultan, Corless & Skelton 2002, Symmetrical reconfiguration of
    tensegrity structures.

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> s = catalogue.tower(stages=2, height=1.0)
    >>> print(f"overlap {2 - s.positions[-1, 2]:.4f} m", len(s.mechanisms()), s.is_stable())
    overlap 0.2405 m 1 True
    """
    check.memory(f"a tower of {stages} stages", 32 * (18.0 * stages) ** 2)
    turns = [t for k in range(stages) for t in ((0, twist), (twist + np.pi / 3, np.pi / 3))[k % 2]]

    def nodes(overlap: float) -> Array:
        levels = [k * (1 - overlap) + end for k in range(stages) for end in (0, 1)]
        return polygon(3, 3**0.5, turns, levels).reshape(-1, 3)

    bars, strings = _stages(nodes(0.0), stages)

    def determinant(overlap: float) -> float:
        """Determinant of the equilibrium of one node of each triangle, without rigid motions."""
        rows = orbit_matrix(nodes(overlap), [*bars, *strings])[::3].reshape(6 * stages, -1)
        sign, size = np.linalg.slogdet(np.delete(rows, [1, 2], axis=0))
        return float(sign * np.exp(size / len(rows)))

    overlap = first_root(determinant, GRID)
    if overlap is None:
        raise EquilibriumError(
            f"twist {twist:g} rad: {stages} stages have no self-stress at any overlap"
        )
    places = nodes(overlap) * [radius, radius, height]
    return prestressed(places, bars, strings, prestrain, k_bar, k_string, mass)


def _stages(x: Array, stages: int) -> tuple[list[Orbit], list[Orbit]]:
    """Bars and strings from triangle to triangle, by their rank in length."""

    def orbit(low: int, high: int, rank: int) -> Orbit:
        far = np.linalg.norm(x[3 * high : 3 * high + 3] - x[3 * low], axis=1)
        first = int(np.argsort(far)[rank])
        return [(3 * low + i, 3 * high + (first + i) % 3) for i in range(3)]

    feet, last = range(0, 2 * stages, 2), 2 * stages - 1
    bars = [orbit(k, k + 1, 2) for k in feet]
    strings = [[(3 * k + i, 3 * k + (i + 1) % 3) for i in range(3)] for k in (0, last)]
    strings += [orbit(k + 1, k + 2, rank) for k in feet[:-1] for rank in (0, 1)]
    strings += [orbit(k, k + 1, 0) for k in feet]
    strings += [orbit(k, k + 2, 0) for k in range(last - 1)]
    return bars, strings


@checked
def dome(
    sides: Sides = 8,
    hoops: Index = 1,
    radius: Length = 1.0,
    rise: Length = 0.25,
    post: Length = 0.35,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Levy's cable dome: a ring of bars, and posts between ridges and diagonals in triangles.

    Parameters
    ----------
    sides : int, optional
        Bars in the ring, and posts in each hoop; at least 3.
    hoops : int, optional
        Number of rings of posts whose feet are joined by strings; 0 gives a wheel about one post.
    radius, rise, post : float, optional
        Of the ring; of the top above the ring; length of the posts, upright [m].  Ridges lie on a
        paraboloid, hoops at equal distances.
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Nodes of the ring come first, to be held as on an abutment, by `held(range(sides))`: the
        free ring of hinged bars may buckle.  Bars: the ring, posts hoop by hoop, the post in the
        middle.  Strings: ridges, diagonals and hoop of each hoop from outside, then ridges and
        diagonals to the middle.

    Raises
    ------
    EquilibriumError
        If a string would be in compression, as in hoops of three sides.

    Notes
    -----
    After Geiger, with the triangles of Levy 1994, The Georgia Dome and beyond.

    Examples
    --------
    >>> from tensegrity import catalogue, held
    >>> s = catalogue.dome(sides=10, hoops=2)
    >>> print(repr(s), s.is_stable(held(range(10))))
    Structure(52 nodes in 3 dimensions, 31 bars, 120 strings, 0 of them slack) True
    """
    check.memory(f"a dome of {hoops} hoops", 32 * (9.0 * sides * (hoops + 1)) ** 2)
    out = 1 - np.arange(hoops + 1) / (hoops + 1)
    bases, turns = 2 * radius * np.sin(np.pi / sides) * out, np.pi / sides * np.arange(hoops + 1)
    heads, feet = (polygon(sides, bases, turns, rise * (1 - out**2) - z) for z in (0.0, post))
    rings = np.stack([heads, feet], axis=1).reshape(-1, sides, 3)
    nodes = np.concatenate([rings[0], *rings[2:], [[0, 0, rise], [0, 0, rise - post]]])
    each, last = range(sides), len(nodes) - 1
    around = [(i, (i + 1) % sides) for i in each]
    bars, strings, outer = [around], [], 0
    for head in range(sides, last - 1, 2 * sides):
        foot = head + sides
        bars.append([(head + i, foot + i) for i in each])
        for inner in (head, foot):
            strings.append([(outer + k, inner + i) for i, j in around for k in (i, j)])
        strings.append([(foot + i, foot + j) for i, j in around])
        outer = head
    bars.append([(last - 1, last)])
    strings += [[(outer + i, end) for i in each] for end in (last - 1, last)]
    return prestressed(nodes, bars, strings, prestrain, k_bar, k_string, mass)
