"""Towers and domes: rings of nodes about an axis, each turned against the ring next to it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.catalogue.symmetry import Orbit, first_root, orbit_matrix, prestressed
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError
from tensegrity.prisms.stack import polygon
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array, Index, Length, NotNegative, Sides

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
