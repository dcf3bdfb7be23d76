"""Bonds in NumPy: elongations, unit vectors, forces on rows, tangent stiffness, and pullbacks.

Used for statics, modes and traces, and by the members of structures.  Rows are those of `Bonds`:
sites, and in a network walls and a spare one; `u` may lack the rows of walls and the spare one, as
contacts do not depend on them.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine import geometry as functions
from tensegrity.engine.bonds import PAIR
from tensegrity.engine.programs import derived, run

PART = 2**15  # contacts in a block; intermediate results take ten times their memory


def connectivity(bonds):
    """The ends of bonds: rows of the first site or wall and of the second site, whether both are
    sites, (bonds,), and `Contacts.geometry`, (dim + 2, bonds); dim is 1 for a chain."""
    contacts, count = bonds.contacts, len(bonds.group)
    if contacts is None:
        first = np.arange(count)
        return first, first + 1, np.ones(count, bool), np.tile([[1.0], [0.0], [1.0]], count)
    return contacts.first, contacts.second, contacts.kind == PAIR, contacts.geometry


def elongations(bonds, u):
    """Elongation r of each bond [m], (..., bonds), and its gradient, (..., bonds, dim).

    `u` has the shape (..., rows, dim), of a chain (..., sites).
    """
    first, second, pair, geometry = connectivity(bonds)
    w = _between(u if bonds.dim else u[..., None], first, second, pair)
    return _elongations_at(bonds, geometry, pair, w), _along(bonds, geometry, pair, w)


def bond_elongations(bonds, u):
    """Elongation of each bond [m], (..., bonds), without its gradient."""
    if bonds.contacts is None:
        return u[..., 1:] - u[..., :-1]
    contacts = bonds.contacts
    elongations = np.empty((*u.shape[:-2], len(contacts.first)), dtype=u.dtype)
    for k in range(0, elongations.shape[-1], PART):
        some = slice(k, k + PART)
        pair = contacts.kind[some] == PAIR
        w = _between(u, contacts.first[some], contacts.second[some], pair)
        all_in_one = elongations.shape[-1] <= PART
        geometry = contacts.geometry if all_in_one else contacts.geometry_of(some)
        elongations[..., some] = _elongations_at(bonds, geometry, pair, w)
    return elongations


def rates(bonds, u, v):
    """Rate of the elongation of each bond and of the gap of each contact with a wall [m/s].

    Parameters
    ----------
    bonds : Bonds
    u, v : ndarray, (..., rows, dim), of a chain (..., sites)
        Displacements [m] and velocities [m/s].

    Returns
    -------
    ndarray, (..., bonds)
    """
    first, second, pair, geometry = connectivity(bonds)
    x, of = (y if bonds.dim else y[..., None] for y in (u, v))
    along = _along(bonds, geometry, pair, _between(x, first, second, pair))
    return np.sum(along * _between(of, first, second, pair), axis=-1)


def _between(u, first, second, pair):
    """Displacement of the second end of each bond from the first, or from a wall."""
    return u[..., second, :] - np.where(pair[:, None], u[..., np.where(pair, first, 0), :], 0)


def _own(bonds, kind, geometry, w):
    """Results, (..., bonds, rows, columns) each, of a function of the law with a geometry of its
    own for relative displacements w; None where there is no such law."""
    law, states = functions.own(bonds.laws), w.shape[:-1]
    if law is None:
        return None
    each = np.broadcast_to(geometry.T, (*states, len(geometry))).reshape(-1, len(geometry)).T
    given = each[:-2], w.reshape(-1, w.shape[-1]).T, each[-2:-1], each[-1:]
    outputs = law.geometry()[kind].map(each.shape[1]).call(given)
    parts = [np.array(x).reshape(x.shape[0], each.shape[1], -1) for x in outputs]
    return [x.swapaxes(0, 1).reshape(*states, len(x), -1) for x in parts]


def _elongations_at(bonds, geometry, pair, w):
    """Elongations for relative displacements w of the ends, (..., bonds, dim)."""
    own = _own(bonds, "pair", geometry, w)
    if own:
        return own[0][..., 0, 0]
    reference, gap, length = geometry[:-2], geometry[-2], geometry[-1]
    r = gap + np.sum(reference.T * w, axis=-1)  # walls, and on a line
    dim = len(reference)
    if dim > 1:
        axes = (*reference[:, pair], *np.moveaxis(w[..., pair, :], -1, 0))
        (r[..., pair],) = run(derived(_elongation, dim), np, (*axes, gap[pair], length[pair]))
    return r


def _along(bonds, geometry, pair, w):
    """Gradient of the elongations with respect to w: unit vectors of pairs, normals of walls."""
    own = _own(bonds, "pair", geometry, w)
    if own:
        return own[1][..., 0]
    reference = geometry[:-2].T
    along = np.broadcast_to(reference, w.shape).astype(w.dtype)
    if w.shape[-1] > 1:
        separation = reference[pair] + w[..., pair, :]
        along[..., pair, :] = separation / np.sqrt(np.sum(separation**2, axis=-1, keepdims=True))
    return along


def _elongation(dim):
    """The elongation of `derivations.geometry`, in (D, w, g, L)."""
    from derivations import geometry

    symbols = (*(x for v in geometry.vectors(dim) for x in v), geometry.initial, geometry.length)
    return [geometry.elongation(dim)], symbols


def _rows(bonds):
    """Number of rows."""
    return len(bonds.group) + 1 if bonds.contacts is None else bonds.contacts.rows


def scattered_forces(bonds, tension, along):
    """Forces of bonds on the rows.

    Parameters
    ----------
    bonds : Bonds
    tension : ndarray, (..., bonds)
        [N]
    along : ndarray, (..., bonds, dim)
        Gradient of the elongations.

    Returns
    -------
    ndarray, (..., rows, dim)
        [N]
    """
    return scattered(*connectivity(bonds)[:2], tension[..., None] * along, _rows(bonds))


def scattered(first, second, each, rows):
    """Vectors of bonds added at their first ends and subtracted at their second ends.

    Parameters
    ----------
    first, second : ndarray of int, (bonds,)
        Rows of the ends.
    each : ndarray, (..., bonds, dim)
    rows : int

    Returns
    -------
    ndarray, (..., rows, dim)
    """
    sums = np.zeros((*each.shape[:-2], rows, each.shape[-1]), dtype=each.dtype)
    by_row, each = np.moveaxis(sums, -2, 0), np.moveaxis(each, -2, 0)  # a view
    np.add.at(by_row, first, each)
    np.subtract.at(by_row, second, each)
    return sums


def tangent(bonds, r, along, tension, stiffness, u=None):
    """Tangent stiffness matrix: the negative derivative of the forces of bonds on the rows.

    Parameters
    ----------
    r, tension, stiffness : ndarray, (bonds,)
        Elongation [m], force [N], and its derivative [N/m].
    along : ndarray, (bonds, dim)
        Gradient of the elongations.
    u : ndarray, (rows, dim), optional
        Displacements [m], of which only a law with a geometry of its own makes use.

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]; the columns of walls are 0, as walls do not move.
    """
    first, second, pair, geometry = connectivity(bonds)
    blocks = tangents(along, stiffness, _density(geometry, pair, r, tension))
    if functions.own(bonds.laws):
        (turning,) = _own(bonds, "tangent", geometry, _between(u, first, second, pair))
        blocks = tangents(along, stiffness, 0 * tension) + tension[:, None, None] * turning
    return assembled(first, second, blocks, _rows(bonds), pair)


def _density(geometry, pair, r, tension):
    """Force densities [N/m], (..., bonds): tension over length; 0 for walls and in a chain."""
    turns = pair & (len(geometry) > 3)
    return np.where(turns, tension / np.where(turns, geometry[-1] + r, 1.0), 0.0)


def tangents(along, stiffness, density):
    """Tangent stiffness of each bond, k n n^T + q (I - n n^T); see `derivations.member`.

    Parameters
    ----------
    along : ndarray, (bonds, dim)
        Unit vectors n.
    stiffness, density : ndarray, (bonds,)
        k and the force density q [N/m].

    Returns
    -------
    ndarray, (bonds, dim, dim)
        [N/m]
    """
    lengthwise = along[:, :, None] * along[:, None, :]
    across = np.eye(along.shape[1]) - lengthwise
    return stiffness[:, None, None] * lengthwise + density[:, None, None] * across


def assembled(first, second, blocks, rows, pair=slice(None)):
    """Tangent stiffness of all bonds as one sparse matrix.

    Parameters
    ----------
    first, second : ndarray of int, (bonds,)
        Rows of the ends.
    blocks : ndarray, (bonds, dim, dim)
        Tangent stiffness of each bond [N/m].
    rows : int
    pair : ndarray of bool, (bonds,), optional
        Bonds whose first end is a site; the others end at walls, which do not move.

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]
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
    """Forces of some bonds at many states, and the pullback of derivatives through them.

    Parameters
    ----------
    layout : Layout
    members : ndarray of int
        Numbers of the bonds.
    rows : sequence of int
        The rows of `u` in their order, which include the ends of the bonds.
    u : ndarray, (..., rows, dim)
        Displacements [m], dim 1 for a chain; 0 for the row of walls.

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
        _, _, pair, geometry = connectivity(layout.bonds)
        pair, geometry = pair[members], geometry[:, members]
        w, of = _between(u, self._first, self._second, pair), layout.bonds
        self.r, self._along = _elongations_at(of, geometry, pair, w), _along(of, geometry, pair, w)
        self._own = _own(of, "tangent", geometry, w)
        self.f, self.k, self._d = layout.laws_at(self.r, members)
        self._density = _density(geometry, pair, self.r, self.f)

    def forces(self):
        """Forces on the rows [N], shape of u."""
        return self._scattered(self.f[..., None] * self._along)

    def _scattered(self, each):
        return scattered(self._first, self._second, each, self._rows)

    def pullback(self, by_force=None, by_tension=0.0, by_elongation=0.0):
        """Derivatives of a number with respect to u, from those with respect to the forces.

        Parameters
        ----------
        by_force : ndarray, shape of u, optional
            Derivatives with respect to the forces on the rows.
        by_tension, by_elongation : ndarray, (..., members), optional
            Derivatives with respect to the tensions and the elongations.

        Returns
        -------
        ub : ndarray, shape of u
            Derivatives with respect to u.
        p : ndarray, (wanted, ..., members)
            Derivatives with respect to the requested parameters, for each state.
        g : ndarray, (..., members)
            Derivatives with respect to the elongations.
        """
        along, turned = self._along, 0.0
        if by_force is not None:
            y = by_force[..., self._first, :] - by_force[..., self._second, :]
            lengthwise = np.sum(y * along, axis=-1)
            by_tension = by_tension + lengthwise
            turned = self._density[..., None] * (y - lengthwise[..., None] * along)
            if self._own:
                turned = self.f[..., None] * (self._own[0] @ y[..., None])[..., 0]
        g = by_tension * self.k + by_elongation
        return -self._scattered(g[..., None] * along + turned), by_tension * self._d, g
