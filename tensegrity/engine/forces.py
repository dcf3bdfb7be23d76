"""Bonds in NumPy: elongations, unit vectors, forces on rows, stiffness, derivatives carried back.

For statics, modes and traces; members of structures take the same forms.  Rows are those of
`Bonds`: sites, and in a network walls and a spare one; the last two may be left out of `u`, as
they do not move contacts.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine.bonds import PAIR
from tensegrity.engine.programs import derived, run

PART = 2**15  # contacts that are done together: what lies between takes ten times their memory


def joined(bonds):
    """What bonds join: rows of the first and second site or wall, whether a bond is between two
    sites, (bonds,), and `Contacts.geometry`, (dim + 2, bonds); a line has dim 1."""
    contacts, count = bonds.contacts, len(bonds.group)
    if contacts is None:
        first = np.arange(count)
        return first, first + 1, np.ones(count, bool), np.tile([[1.0], [0.0], [1.0]], count)
    return contacts.first, contacts.second, contacts.kind == PAIR, contacts.geometry


def elongations(bonds, u):
    """Elongation r of each bond [m], (..., bonds), and its gradient, (..., bonds, dim).

    `u` has the shape (..., rows, dim), on a line (..., sites).
    """
    first, second, pair, geometry = joined(bonds)
    w = _between(u if bonds.dim else u[..., None], first, second, pair)
    return _stretch(geometry, pair, w), _along(geometry, pair, w)


def stretch(bonds, u):
    """The elongations alone."""
    if bonds.contacts is None:
        return np.diff(u, axis=-1)
    first, second, pair, geometry = joined(bonds)
    parts = []
    for k in range(0, max(len(pair), 1), PART):
        some = slice(k, k + PART)
        w = _between(u, first[some], second[some], pair[some])
        parts.append(_stretch(geometry[:, some], pair[some], w))
    return np.concatenate(parts, axis=-1)


def _between(u, first, second, pair):
    """Displacement of the second end of each bond from the first, or from a wall."""
    return u[..., second, :] - np.where(pair[:, None], u[..., np.where(pair, first, 0), :], 0)


def _stretch(geometry, pair, w):
    """Elongations where the ends are displaced by w, (..., bonds, dim), from one another."""
    reference, gap, length = geometry[:-2], geometry[-2], geometry[-1]
    r = gap + np.sum(reference.T * w, axis=-1)  # walls, and on a line
    dim = len(reference)
    if dim > 1:
        axes = (*reference[:, pair], *np.moveaxis(w[..., pair, :], -1, 0))
        (r[..., pair],) = run(derived(_elongation, dim), np, (*axes, gap[pair], length[pair]))
    return r


def _along(geometry, pair, w):
    """Gradient of the elongations in w: unit vectors of pairs, normals of walls."""
    reference = geometry[:-2].T
    along = np.broadcast_to(reference, w.shape).astype(w.dtype)
    if w.shape[-1] > 1:
        apart = reference[pair] + w[..., pair, :]
        along[..., pair, :] = apart / np.sqrt(np.sum(apart**2, axis=-1, keepdims=True))
    return along


def _elongation(dim):
    """The elongation of `derivations.geometry`, in (D, w, g, L)."""
    from derivations import geometry

    symbols = (*(x for v in geometry.vectors(dim) for x in v), geometry.initial, geometry.length)
    return [geometry.elongation(dim)], symbols


def _rows(bonds):
    """Number of rows that bonds join."""
    return len(bonds.group) + 1 if bonds.contacts is None else bonds.contacts.rows


def scattered_forces(bonds, tension, along):
    """What bonds pull at the rows [N], (..., rows, dim)."""
    return scattered(*joined(bonds)[:2], tension[..., None] * along, _rows(bonds))


def scattered(first, second, each, rows):
    """Vectors of bonds (..., bonds, dim) added at their first ends, and taken off at the second;
    (..., rows, dim)."""
    found = np.zeros((*each.shape[:-2], rows, each.shape[-1]), dtype=each.dtype)
    by_row, each = np.moveaxis(found, -2, 0), np.moveaxis(each, -2, 0)  # a view
    np.add.at(by_row, first, each)
    np.subtract.at(by_row, second, each)
    return found


def tangent(bonds, r, along, tension, stiffness):
    """Derivative of what bonds pull at the rows, with its sign turned: the stiffness matrix.

    Parameters
    ----------
    r, tension, stiffness : ndarray, (bonds,)
        Elongation [m], force [N], and its derivative [N/m].
    along : ndarray, (bonds, dim)

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]; a wall has columns of zeros, as its row does not move it.
    """
    first, second, pair, geometry = joined(bonds)
    blocks = tangents(along, stiffness, _density(geometry, pair, r, tension))
    return assembled(first, second, blocks, _rows(bonds), pair)


def _density(geometry, pair, r, tension):
    """Force densities [N/m], (..., bonds): tension over length; 0 of walls and on a line."""
    turns = pair & (len(geometry) > 3)
    return np.where(turns, tension / np.where(turns, geometry[-1] + r, 1.0), 0.0)


def tangents(along, stiffness, density):
    """Tangent of each bond in its own separation [N/m], (bonds, dim, dim), from the unit vectors
    (bonds, dim): k n n^T + q (I - n n^T), see `derivations.member`."""
    lengthwise = along[:, :, None] * along[:, None, :]
    across = np.eye(along.shape[1]) - lengthwise
    return stiffness[:, None, None] * lengthwise + density[:, None, None] * across


def assembled(first, second, blocks, rows, pair=slice(None)):
    """Tangents of bonds (bonds, dim, dim) in one sparse matrix, (rows dim, rows dim).

    Only where `pair` says so does the row of the first end move a bond.
    """
    from scipy.sparse import coo_array

    axis, dim = np.arange(blocks.shape[-1]), blocks.shape[-1]
    at, to, values = [], [], []
    for row, column, sign, members in (
        (second, second, 1, slice(None)),
        (first, second, -1, slice(None)),
        (first, first, 1, pair),
        (second, first, -1, pair),
    ):
        matrix = sign * blocks[members]
        i, j = (dim * x[members][:, None, None] for x in (row, column))
        at.append(np.broadcast_to(i + axis[:, None], matrix.shape).ravel())
        to.append(np.broadcast_to(j + axis, matrix.shape).ravel())
        values.append(matrix.ravel())
    entries = np.concatenate(values), (np.concatenate(at), np.concatenate(to))
    return coo_array(entries, shape=(dim * rows, dim * rows))


class BondForces:
    """Some bonds at many states at once, and derivatives carried back through them.

    Parameters
    ----------
    layout : Layout
    members : ndarray of int
        Numbers of the bonds.
    rows : sequence of int
        The rows that `u` has, in their order; among them all that the bonds join.
    u : ndarray, (..., rows, dim)
        Displacements, on a line with dim 1; 0 of the row of walls.

    Attributes
    ----------
    r, f, k : ndarray, (..., members)
        Elongation [m], tension [N], and its derivative [N/m].
    """

    def __init__(self, layout, members, rows, u):
        place = np.full(layout.rows, -1)
        place[rows] = np.arange(len(rows))
        self.members, self._rows = members, len(rows)
        self._first, self._second = (place[x[members]] for x in layout.ends)
        _, _, pair, geometry = joined(layout.bonds)
        pair, geometry = pair[members], geometry[:, members]
        w = _between(u, self._first, self._second, pair)
        self.r, self._along = _stretch(geometry, pair, w), _along(geometry, pair, w)
        self.f, self.k, self._d = layout.laws_at(self.r, members)
        self._density = _density(geometry, pair, self.r, self.f)

    def forces(self):
        """Forces on the rows, shape of u."""
        return self._scattered(self.f[..., None] * self._along)

    def _scattered(self, each):
        return scattered(self._first, self._second, each, self._rows)

    def back(self, by_force=None, by_tension=0.0, by_elongation=0.0):
        """From derivatives by forces on rows, tensions and elongations of bonds to those by u.

        Each has the shape of what it belongs to.

        Returns
        -------
        ub : ndarray, shape of u
        p : ndarray, (wanted, ..., members)
            By the parameters wanted, summed over nothing.
        g : ndarray, (..., members)
            By the elongation.
        """
        along, turned = self._along, 0.0
        if by_force is not None:
            y = by_force[..., self._first, :] - by_force[..., self._second, :]
            lengthwise = np.sum(y * along, axis=-1)
            by_tension = by_tension + lengthwise
            turned = self._density[..., None] * (y - lengthwise[..., None] * along)
        g = by_tension * self.k + by_elongation
        return -self._scattered(g[..., None] * along + turned), by_tension * self._d, g
