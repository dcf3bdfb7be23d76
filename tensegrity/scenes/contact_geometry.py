"""Where the contacts of a network are at its reference places, to more digits than these have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.scenes.network_input import near_positions, numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tensegrity.scenes.walls import Wall
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
    apart = exact[bonds[:, 1]] - exact[bonds[:, 0]]
    distance = np.sqrt(np.sum(apart**2, axis=1))
    lengths, opening = _lengths(lengths, bonds, distance)
    site, wall = wall_contacts.T
    dim = positions.shape[1]
    normals = np.array([w.normal for w in walls]).reshape(-1, dim)[wall]
    heights = [walls[w].height(exact[s]) for s, w in wall_contacts.tolist()]
    room = np.zeros(0) if radius is None else radius[site]
    gaps = (np.array(heights, dtype=np.longdouble) - room).astype(float)
    if wall_gaps is not None:
        gaps = near_positions(wall_gaps, gaps, room)
    geometry = np.zeros((dim + 2, len(bonds) + len(gaps)))
    reference = np.sign(apart) if dim == 1 else apart
    geometry[:dim] = np.concatenate([reference.astype(float), normals]).T
    geometry[dim] = np.concatenate([opening, gaps])
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
