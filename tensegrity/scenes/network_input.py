"""Validation of the arguments of a network (positions, bonds, walls, springs), and the geometry of
its contacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import Repeated
from tensegrity.scenes.near_pairs import blocks, distances
from tensegrity.scenes.scene import SMALLEST_MASS
from tensegrity.scenes.walls import Wall, WallArrays
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
    """Lengths of all contacts and their elongations at the reference positions.

    Parameters
    ----------
    positions : ndarray, (sites, dim)
        Reference positions [m].
    bonds : ndarray of int, (bonds, 2)
    lengths : float, array_like (bonds,), or None
        Distance at which the elongation is 0 [m]; None: the distance in `positions`.
    walls : sequence of Wall
    wall_contacts : ndarray of int, (wall contacts, 2)
        Site and wall of each contact.
    radius : ndarray, (sites,), or None
        [m]; None only without wall contacts.
    wall_gaps : array_like (wall contacts,), optional
        Gaps that replace those of the positions [m].

    Returns
    -------
    lengths : ndarray, (bonds + wall contacts,)
        [m].  Of all contacts: of the bonds, and 0 of contacts with walls.
    gaps : ndarray, (bonds + wall contacts,)
        Initial elongation, or gap to the wall [m].

    Raises
    ------
    TensegrityError
        Two joined sites that coincide, a length <= 0, or a gap far from that of the positions.
    """
    count, (site, wall) = len(bonds), wall_contacts.T
    spans, gaps = np.zeros((2, count + len(site)))
    given = None if lengths is None else _given_lengths(lengths, count)
    x = exact(positions)
    for some in blocks(count):
        distance: Any = distances(x, *bonds[some].T)
        if not distance.all():
            number = some.start + int(np.argmin(distance))
            i, j = bonds[number]
            raise TensegrityError(f"bond {number} joins sites {i} and {j} at the same place")
        spans[:count][some] = distance if given is None else given[some]
        if given is not None:
            gaps[:count][some] = distance - given[some]
    heights = WallArrays(walls, positions.shape[1]).height(x[site], wall)
    radii = np.zeros(len(site)) if radius is None else radius[site]
    gaps[count:] = heights - radii
    if wall_gaps is not None:
        gaps[count:] = checked_wall_gaps(wall_gaps, gaps[count:], radii)
    return spans, gaps if gaps.any() else np.broadcast_to(0.0, gaps.shape)


def exact(values: Array) -> Any:
    """Values in extended precision."""
    return values.astype(np.longdouble)


def _given_lengths(lengths: ArrayLike, count: int) -> Array:
    """Natural lengths of the bonds [m], checked."""
    lengths = numbers("lengths", lengths)
    if lengths.shape not in ((), (count,)):
        raise TensegrityError(f"lengths have shape {lengths.shape}, must be ({count},)")
    lengths = np.broadcast_to(lengths, (count,)).copy()
    bad = np.flatnonzero(~(lengths > 0))
    if bad.size:
        raise TensegrityError(f"length {lengths[bad[0]]:g} m of bond {bad[0]} must be above 0")
    return lengths


CUT = 1e-12  # distance behind a wall that is round-off, over the distance from its point
GAP_TOLERANCE = 0.1  # largest difference of `wall_gaps` from the positions' gaps, over the radius
LARGEST = 2**29  # sites and walls: the loop numbers their rows, of four numbers, with 32 bits


def refuse_too_many(sites: int) -> None:
    """Refuse more sites and walls than the compiled loop can number."""
    if sites > LARGEST:
        raise TensegrityError(
            f"{sites} sites and walls must be at most {LARGEST}: the loop numbers them with 32 bits"
        )


def site_number(name: str, value: object, sites: int) -> int:
    """A site index, 0 <= value < sites.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
    sites : int

    Returns
    -------
    int
    """
    return check.whole(name, value, least=0, below=sites)


def per_site(name: str, value: ArrayLike, unit: str, sites: int) -> Array:
    """Positive values of all sites.

    Parameters
    ----------
    name, unit : str
        The argument and its unit, for the message.
    value : float or array_like (sites,)
    sites : int

    Returns
    -------
    ndarray, (sites,)

    Raises
    ------
    TensegrityError
        Another shape, or a value below the smallest mass.
    """
    return _per_item(name, value, unit, sites, "site", SMALLEST_MASS)


def _per_item(name: str, value: ArrayLike, unit: str, count: int, of: str, least: float) -> Array:
    """Values of all sites or bonds, named by `of`, each at least `least`."""
    given = numbers(name, value)
    if given.ndim and given.shape != (count,):
        raise TensegrityError(f"{name} has shape {given.shape}, must be ({count},)")
    values = np.broadcast_to(given, (count,)).copy()
    bad = np.flatnonzero(~(values >= least))
    if bad.size:
        raise TensegrityError(
            f"{name} {values[bad[0]]:g} {unit} of {of} {bad[0]} must be at least {least:g}"
        )
    return values


def masses(
    mass: ArrayLike | None, bond_mass: ArrayLike, bonds: Indices, sites: int, moving: Indices
) -> tuple[Array, Array]:
    """Masses at the sites and of the bonds.

    Parameters
    ----------
    mass : float or array_like (sites,), or None
        None for 0.
    bond_mass : float or array_like (bonds,)
    bonds : ndarray of int, (bonds, 2)
    sites : int
    moving : ndarray of int
        Sites that are not held.

    Returns
    -------
    ndarray, (sites,) and (bonds,)
        [kg]

    Raises
    ------
    TensegrityError
        A mass below 0, or a site without mass that moves.
    """
    at_sites = _per_item("mass", 0.0 if mass is None else mass, "kg", sites, "site", 0.0)
    of_bonds = _per_item("bond_mass", bond_mass, "kg", len(bonds), "bond", 0.0)
    total = at_sites.copy()
    np.add.at(total, bonds, of_bonds[:, None] / 2)
    bad = moving[~(total[moving] >= SMALLEST_MASS)]
    if bad.size:
        raise TensegrityError(
            f"site {bad[0]} has mass {total[bad[0]]:g} kg with half of its bonds', must be at "
            f"least {SMALLEST_MASS:g}: a site without mass cannot move"
        )
    return at_sites, of_bonds


def held_sites(held: Iterable[int], sites: int) -> list[int]:
    """Indices of the held sites, sorted and without duplicates."""
    numbers = check.sequence("held", held, "sites")
    return sorted({site_number("held site", site, sites) for site in numbers})


def checked_bonds(bonds: ArrayLike, sites: int) -> Indices:
    """Bonds as pairs of different sites, which several may join; (bonds, 2)."""
    bonds = whole_pairs("bonds", bonds)
    low, high = np.minimum(*bonds.T), np.maximum(*bonds.T)
    wrong = np.flatnonzero((low < 0) | (high >= sites) | (low == high))
    if wrong.size:
        number, (i, j) = wrong[0], bonds[wrong[0]].tolist()
        if i == j and 0 <= i < sites:
            raise TensegrityError(f"bond {number} joins site {i} to itself")
        raise TensegrityError(
            f"bond {number} joins sites {i} and {j}, which must be 0 to {sites - 1}"
        )
    return bonds


def contact_ends(bonds: Indices, wall_contacts: Indices, sites: int) -> tuple[Indices, Indices]:
    """Rows that each contact joins, sites and after them walls, the wall first.

    Parameters
    ----------
    bonds : ndarray of int, (bonds, 2)
    wall_contacts : ndarray of int, (wall contacts, 2)
        Site and wall of each.
    sites : int

    Returns
    -------
    ends, bonds : ndarray of int, (bonds + wall contacts, 2), (bonds, 2)
        All, and as a view those of the bonds, with contiguous columns.
    """
    ends: Any = np.empty((2, len(bonds) + len(wall_contacts)), dtype=np.int32)
    ends[:, : len(bonds)] = bonds.T
    ends[0, len(bonds) :] = sites + wall_contacts[:, 1]
    ends[1, len(bonds) :] = wall_contacts[:, 0]
    ends.flags.writeable = False
    return ends.T, ends.T[: len(bonds)]


def plane_walls(walls: Iterable[Wall], dim: int) -> tuple[Wall, ...]:
    """Walls, each with as many coordinates as the sites."""
    walls = check.sequence("walls", walls, "Walls")
    for number, wall in enumerate(walls):
        if not isinstance(wall, Wall):
            raise TensegrityError(f"wall {number} is {check.shown(wall)}, not a Wall")
        if wall.point.size != dim:
            raise TensegrityError(
                f"wall {number} has {wall.point.size} coordinates, the sites have {dim}"
            )
    return walls


def pressing(
    positions: Array, radius: Array | None, walls: Sequence[Wall], given: dict[str, Any]
) -> Indices:
    """The contacts of all sites with all walls, where sites press walls alone.

    Parameters
    ----------
    positions : ndarray, (sites, dim)
        [m].
    radius : ndarray, (sites,), or None
        [m]; None for points.
    walls : sequence of Wall
    given : dict
        {argument: whether it is given} of arguments that exclude this.

    Returns
    -------
    ndarray of int, (sites walls, 2)
        Site and wall of each.

    Raises
    ------
    TensegrityError
        One of these arguments, a bounded wall, or a wall that cuts the positions.
    """
    for name, excluded in given.items():
        if excluded:
            raise TensegrityError(f"contacts 'walls' exclude {name}: all sites press all walls")
    for number, wall in enumerate(walls):
        if wall.extent is not None:
            raise TensegrityError(f"wall {number} must be unbounded: contacts are 'walls'")
        heights = wall.height(positions) - (0.0 if radius is None else radius)
        lowest = int(np.argmin(heights))
        if heights[lowest] < -CUT * np.abs(positions - wall.point).max():
            raise TensegrityError(
                f"wall {number} cuts the start: site {lowest} is {-heights[lowest]:.6g} m behind it"
            )
    return np.indices((len(positions), len(walls))).reshape(2, -1).T


def checked_wall_contacts(contacts: Indices, walls: Sequence[Wall], positions: Array) -> Indices:
    """Contacts with walls, without duplicates, each with the site's projection inside the wall.

    Parameters
    ----------
    contacts : ndarray of int, (contacts, 2)
        Site and wall.
    walls : sequence of Wall
    positions : ndarray, (sites, dim)
        [m].

    Returns
    -------
    ndarray of int, (contacts, 2)

    Raises
    ------
    TensegrityError
        A site or wall that does not exist, a site beyond the edge of its wall, or a duplicate.
    """
    site, wall = contacts.T
    wrong = (site < 0) | (site >= len(positions)) | (wall < 0) | (wall >= len(walls))
    if wrong.any():
        number = int(np.argmax(wrong))
        site_number(f"site of wall contact {number}:", int(site[number]), len(positions))
        raise TensegrityError(
            f"wall contact {number} is with wall {wall[number]}, there are {len(walls)}"
        )
    beyond = WallArrays(walls, positions.shape[1]).overhang(positions[site], wall)
    if np.any(beyond > 0):
        worst = int(np.argmax(beyond > 0))
        raise TensegrityError(
            f"site {site[worst]} is {beyond[worst]:.3g} m beyond the end of wall {wall[worst]}"
        )
    _refuse_duplicates(site * len(walls) + wall)
    return contacts


def checked_wall_gaps(gaps: ArrayLike, distances: Array, radius: Array) -> Array:
    """Gaps of wall contacts, each close to that of the positions.

    Parameters
    ----------
    gaps : array_like, (contacts,)
        [m].
    distances : ndarray, (contacts,)
        Gaps of the positions [m].
    radius : ndarray, (contacts,)
        Radius of the site of each contact [m].

    Returns
    -------
    ndarray, (contacts,)

    Raises
    ------
    TensegrityError
        Another shape, or a difference above a tenth of the radius.
    """
    gaps = numbers("wall_gaps", gaps, distances.shape)
    far = np.flatnonzero(np.abs(gaps - distances) > GAP_TOLERANCE * radius)
    if far.size:
        k = int(far[0])
        raise TensegrityError(
            f"gap {gaps[k]:.6g} m of wall contact {k} must be within "
            f"{GAP_TOLERANCE * radius[k]:.3g} m, {GAP_TOLERANCE:g} of the radius, of "
            f"{distances[k]:.6g} m, which the positions give"
        )
    return gaps


def numbers(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """`value` as an array of finite floats, which is not copied if it is one.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : array_like
    shape : tuple of int, optional
        Required shape; by default any.

    Returns
    -------
    ndarray
    """
    array = check.floats(name, value)
    return check.vector(name, array, array.shape if shape is None else shape)


def whole_pairs(name: str, pairs: ArrayLike) -> Indices:
    """Pairs of integers as an array (n, 2)."""
    try:
        array = np.asarray(pairs)
    except ValueError:  # of different lengths
        raise TensegrityError(f"{name} {check.shown(pairs)} must be pairs of numbers") from None
    if array.size == 0 and isinstance(pairs, (tuple, list, np.ndarray)):
        return np.zeros((0, 2), dtype=int)
    if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
        raise TensegrityError(
            f"{name} of shape {array.shape} and type {array.dtype} must be pairs of whole numbers"
        )
    return array if array.dtype.kind == "i" else array.astype(int)


def _refuse_duplicates(keys: Indices) -> None:
    """Refuse wall contacts of which two have the same key."""
    if np.all(keys[1:] > keys[:-1]):
        return
    ordered = np.sort(keys)
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    if same.size:
        twins = np.flatnonzero(keys == ordered[same[0]])
        raise TensegrityError(f"wall contacts {twins[0]} and {twins[1]} are the same")


def springs_of(spring: Potential | Sequence[Potential] | None, count: int, name: str) -> Repeated:
    """One potential for each bond or contact.

    Parameters
    ----------
    spring : Potential or sequence of Potential
        One for all, or one for each.
    count : int
    name : str
        "bond" or "wall contact", for the message.

    Returns
    -------
    Repeated of Potential, (count,)

    Raises
    ------
    TensegrityError
        Anything that is not a Potential, or another number of them.
    """
    if isinstance(spring, Potential):
        return Repeated((spring,), np.zeros(count, dtype=int))
    if not isinstance(spring, Sequence):
        raise TensegrityError(
            f"spring {check.shown(spring)} of the {name}s is not a Potential, nor a list"
            f"{check.made_by(spring, Potential)}"
        )
    springs = Repeated.of(spring)
    if len(springs) != count:
        raise TensegrityError(f"{len(springs)} springs for {count} {name}s")
    for number, one in enumerate(springs.different):
        if not isinstance(one, Potential):
            first = int(np.argmax(springs.number == number))
            check.kind(f"spring of {name} {first}", one, Potential)
    return springs
