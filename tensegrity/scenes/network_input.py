"""What a network is built from, checked: places, bonds, walls, springs; and where contacts lie."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.scenes.scene import SMALLEST_MASS
from tensegrity.scenes.walls import Wall, floats
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Indices


def contact_geometry(
    positions: Array,
    bonds: Indices,
    lengths: ArrayLike | None,
    walls: Sequence[Wall],
    wall_contacts: Indices,
    radius: Array | None,
    wall_gaps: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Lengths of the bonds [m], (bonds,), and geometry of all contacts, (dim + 2, contacts).

    The latter is, for each, the reference separation of a bond's sites or the normal of a wall,
    the initial elongation or gap [m], and the length, 0 for contacts with walls [m].  On a line the
    separation is 1 or -1.
    """
    exact = positions.astype(np.longdouble)
    separation = exact[bonds[:, 1]] - exact[bonds[:, 0]]
    distance = np.sqrt(np.sum(separation**2, axis=1))
    lengths, elongation = _lengths(lengths, bonds, distance)
    site, wall = wall_contacts.T
    dim = positions.shape[1]
    normals = np.array([w.normal for w in walls]).reshape(-1, dim)[wall]
    heights = [walls[w].height(exact[s]) for s, w in wall_contacts.tolist()]
    radii = np.zeros(0) if radius is None else radius[site]
    gaps = (np.array(heights, dtype=np.longdouble) - radii).astype(float)
    if wall_gaps is not None:
        gaps = checked_wall_gaps(wall_gaps, gaps, radii)
    geometry = np.zeros((dim + 2, len(bonds) + len(gaps)))
    reference = np.sign(separation) if dim == 1 else separation
    geometry[:dim] = np.concatenate([reference.astype(float), normals]).T
    geometry[dim] = np.concatenate([elongation, gaps])
    geometry[-1, : len(bonds)] = lengths
    return lengths, geometry


def _lengths(lengths: ArrayLike | None, bonds: Indices, distance: Array) -> tuple[Array, Array]:
    """Lengths as given, or so that bonds are at rest; elongations at given distances."""
    same = np.flatnonzero(distance == 0)
    if same.size:
        i, j = bonds[same[0]]
        raise TensegrityError(f"bond {same[0]} joins sites {i} and {j} at the same place")
    if lengths is None:
        return distance.astype(float), np.zeros(len(bonds))
    lengths = numbers("lengths", lengths)
    if lengths.shape not in ((), (len(bonds),)):
        raise TensegrityError(f"lengths have shape {lengths.shape}, must be ({len(bonds)},)")
    lengths = np.broadcast_to(lengths, (len(bonds),)).copy()
    bad = np.flatnonzero(~(lengths > 0))
    if bad.size:
        raise TensegrityError(f"length {lengths[bad[0]]:g} m of bond {bad[0]} must be above 0")
    return lengths, (distance - lengths).astype(float)


GAP_TOLERANCE = 0.1  # of the radius: what a given wall gap may differ from that of the positions


def site_number(name: str, value: object, sites: int) -> int:
    """One of the sites, from 0."""
    return check.whole(name, value, least=0, below=sites)


def per_site(name: str, value: ArrayLike, unit: str, sites: int) -> Array:
    """Positive values of all sites, read-only; (sites,)."""
    given = numbers(name, value)
    if given.ndim and given.shape != (sites,):
        raise TensegrityError(f"{name} has shape {given.shape}, must be ({sites},)")
    values = np.broadcast_to(given, (sites,)).copy()
    bad = np.flatnonzero(~(values >= SMALLEST_MASS))
    if bad.size:
        raise TensegrityError(
            f"{name} {values[bad[0]]:g} {unit} of site {bad[0]} must be at least {SMALLEST_MASS:g}"
        )
    return values


def held_sites(held: Iterable[int], sites: int) -> list[int]:
    """Sites without motion, sorted."""
    numbers = check.sequence("held", held, "sites")
    return sorted({site_number("held site", site, sites) for site in numbers})


def checked_bonds(bonds: ArrayLike, sites: int) -> Indices:
    """Pairs of different sites, none twice; (bonds, 2)."""
    bonds = whole_pairs("bonds", bonds)
    for number, (i, j) in enumerate(bonds.tolist()):
        if not 0 <= min(i, j) <= max(i, j) < sites:
            raise TensegrityError(
                f"bond {number} joins sites {i} and {j}, which must be 0 to {sites - 1}"
            )
        if i == j:
            raise TensegrityError(f"bond {number} joins site {i} to itself")
    _refuse_duplicates("bond", np.sort(bonds, axis=1))
    return bonds


def plane_walls(walls: Iterable[Wall], dim: int) -> tuple[Wall, ...]:
    """Walls of as many coordinates as the sites."""
    walls = check.sequence("walls", walls, "Walls")
    for number, wall in enumerate(walls):
        if not isinstance(wall, Wall):
            raise TensegrityError(f"wall {number} is {check.shown(wall)}, not a Wall")
        if wall.point.size != dim:
            raise TensegrityError(
                f"wall {number} has {wall.point.size} coordinates, the sites have {dim}"
            )
    return walls


def checked_wall_contacts(contacts: Indices, walls: Sequence[Wall], positions: Array) -> Indices:
    """Pairs of a site and a wall that reaches beside it, none twice; (contacts, 2)."""
    for number, (site, wall) in enumerate(contacts.tolist()):
        site_number(f"site of wall contact {number}:", site, len(positions))
        if not 0 <= wall < len(walls):
            raise TensegrityError(
                f"wall contact {number} is with wall {wall}, there are {len(walls)}"
            )
        beyond = walls[wall].overhang(positions[site])
        if beyond > 0:
            raise TensegrityError(f"site {site} is {beyond:.3g} m beyond the end of wall {wall}")
    _refuse_duplicates("wall contact", contacts)
    return contacts


def checked_wall_gaps(gaps: ArrayLike, found: Array, radius: Array) -> Array:
    """Gaps of wall contacts, none far from what the positions give; (contacts,)."""
    gaps = numbers("wall_gaps", gaps, found.shape)
    far = np.flatnonzero(np.abs(gaps - found) > GAP_TOLERANCE * radius)
    if far.size:
        k = int(far[0])
        raise TensegrityError(
            f"gap {gaps[k]:.6g} m of wall contact {k} must be within "
            f"{GAP_TOLERANCE * radius[k]:.3g} m, {GAP_TOLERANCE:g} of the radius, of "
            f"{found[k]:.6g} m, which the positions give"
        )
    return gaps


def numbers(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """`value` as a finite float array, of a given shape where one is given."""
    array = floats(name, value)
    return check.vector(name, array, array.shape if shape is None else shape)


def whole_pairs(name: str, pairs: ArrayLike) -> Indices:
    """Pairs of whole numbers as an array (n, 2)."""
    try:
        array = np.array(pairs)
    except ValueError:  # of different lengths
        raise TensegrityError(f"{name} {check.shown(pairs)} must be pairs of numbers") from None
    if array.size == 0 and isinstance(pairs, (tuple, list, np.ndarray)):
        return np.zeros((0, 2), dtype=int)
    if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
        raise TensegrityError(
            f"{name} of shape {array.shape} and type {array.dtype} must be pairs of whole numbers"
        )
    return array.astype(int)


def _refuse_duplicates(name: str, pairs: Indices) -> None:
    _, back, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    if np.any(count > 1):
        twins = np.flatnonzero(back.ravel() == np.argmax(count > 1))
        raise TensegrityError(f"{name}s {twins[0]} and {twins[1]} are the same")


def springs_of(
    spring: Potential | Sequence[Potential] | None, count: int, name: str
) -> tuple[Potential, ...]:
    """One potential for each of `count` bonds or contacts."""
    if isinstance(spring, Potential):
        return (spring,) * count
    if not isinstance(spring, Sequence):
        raise TensegrityError(
            f"spring {check.shown(spring)} of the {name}s is not a Potential, nor a list"
        )
    springs = tuple(spring)
    if len(springs) != count:
        raise TensegrityError(f"{len(springs)} springs for {count} {name}s")
    for number, one in enumerate(springs):
        if not isinstance(one, Potential):
            raise TensegrityError(
                f"spring of {name} {number} is {check.shown(one)}, not a Potential"
            )
    return springs
