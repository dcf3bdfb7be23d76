"""What prisms touch: bars with a finite diameter one another along a path, and a sheath.

The path is that of members without thickness, and is not valid beyond the contact.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise
from tensegrity.prisms.prism import Prism
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.prisms.stack import symmetric_nodes
from tensegrity.springs.potential import Potential
from tensegrity.structures.structure_path import StructurePath
from tensegrity.typing import Array, Length


class BarContact(NamedTuple):
    """The first contact of two bars along a path."""

    bars: tuple[int, int]  #: numbers of the two bars
    shortening: float  #: [m]; on paths of `control_path` the control
    load: float  #: [N]; on paths of `control_path` 0
    distance: float  #: between their axes at the reference [m]

    def __str__(self) -> str:
        return concise(self)


@checked
def bar_contact(path: EquilibriumPath | StructurePath, diameter: Length) -> BarContact | None:
    """The first contact of bars of a given diameter along a path.

    Parameters
    ----------
    path : EquilibriumPath or StructurePath
        From `equilibrium_path` or `control_path`.
    diameter : float
        Diameter of all bars [m].

    Returns
    -------
    BarContact or None
        None if the bars do not touch on the path.  Between rows the distance between axes is
        interpolated linearly in the first column.

    Raises
    ------
    TensegrityError
        If the diameter is not positive, or `path` is no equilibrium path.
    """
    if isinstance(path, EquilibriumPath):
        start = int(np.argmin(np.abs(path.shortening)))
        n = path.prism.sides
        x = symmetric_nodes(n, path.base, path.twist, path.height)[start:]
        pairs = _free_pairs([(j, n + j) for j in range(n)])
        along, load = path.shortening[start:], path.load[start:]
    elif isinstance(path, StructurePath):
        x = path.positions
        pairs = _free_pairs(path.structure.ends[: path.structure.bars].tolist())
        names = list(path.columns)
        along = path.columns[names[0]]
        load = path.columns["load"] if "load" in names else np.zeros(len(along))
    else:
        raise TensegrityError(
            f"path {check.shown(path)} must be a path of equilibria: equilibrium_path(prism)"
        )
    first = None
    for numbers, ends in pairs:
        gaps = distances(x, ends) - diameter
        touching = np.flatnonzero(gaps <= 0)
        if not touching.size:
            continue
        row = int(touching[0])
        place = float(row)
        if row:
            place = row - 1 + float(gaps[row - 1] / (gaps[row - 1] - gaps[row]))
        if first is None or place < first[0]:
            first = place, numbers, float(gaps[0] + diameter)
    if first is None:
        return None
    rows = np.arange(len(along))
    at = float(np.interp(first[0], rows, along)), float(np.interp(first[0], rows, load))
    return BarContact(first[1], *at, first[2])


def distances(x: Array, ends: tuple[int, int, int, int]) -> Array:
    """Distances [m], (rows,), between two segments at positions x (rows, nodes, dim)."""
    a, b, c, d = (x[:, node] for node in ends)
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = (np.sum(p * q, axis=1) for p, q in ((u, u), (u, v), (v, v)))
    uw, vw = np.sum(u * w, axis=1), np.sum(v * w, axis=1)
    shortest = np.full(len(x), np.inf)
    det = uu * vv - uv**2
    s = np.where(det > 1e-12 * uu * vv, (uv * vw - vv * uw) / np.where(det > 0, det, 1), 0.0)
    for part in (np.clip(s, 0, 1), np.ones(len(x))):  # the other end, for parallel bars
        t = np.clip((uv * part + vw) / vv, 0, 1)
        s = np.clip((uv * t - uw) / uu, 0, 1)
        gap = w + s[:, None] * u - t[:, None] * v
        shortest = np.minimum(shortest, np.sqrt(np.sum(gap**2, axis=1)))
    return shortest


def _free_pairs(
    bars: list[tuple[int, int]],
) -> list[tuple[tuple[int, int], tuple[int, int, int, int]]]:
    return [
        ((i, j), (*bars[i], *bars[j]))
        for i, j in combinations(range(len(bars)), 2)
        if not {*bars[i]} & {*bars[j]}
    ]


@checked
def sheath(
    prism: Prism,
    G: Annotated[float, "> 0", "Pa"],
    outer: Length,
    radius: Length | None = None,
) -> Potential:
    """The springs between the prisms of a chain and a sheath around it that is held outside.

    A unit that moves along the axis shears the sheath (shear lag): its force is 2 pi G h/ln(R/a)
    times its displacement, for the height h of the prism, radius a and outer radius R.  The sheath
    has no mass, and does not carry shear from unit to unit.

    Parameters
    ----------
    prism : Prism
    G : float
        Shear modulus of the sheath [Pa], > 0.
    outer : float
        Outer radius of the sheath [m], > the radius.
    radius : float, optional
        At which the prisms hold on [m]; by default their circumradius.

    Returns
    -------
    Potential
        For `Chain(ground=)`.

    Raises
    ------
    TensegrityError
        A number outside its bounds.

    References
    ----------
    Cox 1952, The elasticity and strength of paper and other fibrous materials.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, sheath
    >>> prism = Prism(1, 0.7, 0.1, 1, 5, 50)
    >>> held = sheath(prism, G=0.05, outer=1, radius=0.6)
    >>> float(held.stiffness(0.0).round(6))
    0.430502
    >>> Chain(prism.potential(), 20, mass=3, ground=held).sites
    20
    """
    import sympy as sp

    inner = prism.circumradius if radius is None else radius
    if not outer > inner:
        raise TensegrityError(f"outer {outer:g} m must be above the radius {inner:g} m")
    r, k = sp.symbols("r k")
    stiffness = 2 * math.pi * G * prism.height / math.log(outer / inner)
    return Potential(k * r**2 / 2, r, {k: stiffness}, length=prism.height)
