"""Bonds in NumPy: elongations, unit vectors, forces on rows, tangent stiffness, and pullbacks.

Used for statics, modes and traces, and by the members of structures.  Rows are those of `Bonds`:
sites, and in a network walls and a spare one; `u` may lack the rows of walls and the spare one, as
contacts do not depend on them.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine import geometry as functions
from tensegrity.engine.bonds import PAIR
from tensegrity.engine.programs import derived, run
from tensegrity.errors import TensegrityError

PART = 2**15  # contacts in a block; intermediate results take ten times their memory


def connectivity(bonds):
    """The ends of bonds: rows of the first site or wall and of the second site, whether both are
    sites, (bonds,), and `Contacts.geometry`, (dim + 2, bonds); dim is 1 for a chain."""
    contacts, count = bonds.contacts, len(bonds.group)
    if contacts is None:
        first, geometry = np.arange(count), np.tile([[1.0], [0.0], [1.0]], count)
        second = first + 1
        if bonds.stretch is not None:
            second[-1], geometry[1, -1] = 0, bonds.stretch
        return first, second, np.ones(count, bool), geometry
    return contacts.first, contacts.second, contacts.kind == PAIR, contacts.geometry


def elongations(bonds, u):
    """Elongation r of each bond [m], (..., bonds), and its gradient, (..., bonds, dim); by both
    ends of bonds with a law of these, (..., bonds, 2 dim).

    `u` has the shape (..., rows, dim), of a chain (..., sites).
    """
    if functions.own(bonds.laws):
        r, along = _of_ends(bonds, "pair", u)
        return r[..., 0], along
    first, second, pair, geometry = connectivity(bonds)
    w = _between(u if bonds.dim else u[..., None], first, second, pair)
    r = averaged(bonds, _elongations_at(bonds, geometry, pair, w))
    return r, _along(bonds, geometry, pair, w)


def averaged(bonds, r):
    """Elongations or their rates (..., bonds), of the segments of cables over sites the mean."""
    if bonds.cable is None:
        return r
    r = r.copy()
    for cable in range(bonds.cable.max() + 1):
        segments = bonds.cable == cable
        r[..., segments] = r[..., segments].mean(axis=-1, keepdims=True)
    return r


def bond_elongations(bonds, u):
    """Elongation of each bond [m], (..., bonds), without its gradient."""
    if bonds.stretch is not None:
        last = u[..., :1] - u[..., -1:] + bonds.stretch
        return np.concatenate([u[..., 1:] - u[..., :-1], last], axis=-1)
    if bonds.contacts is None:
        return u[..., 1:] - u[..., :-1]
    contacts = bonds.contacts
    elongations = np.empty((*u.shape[:-2], len(contacts.first)), dtype=u.dtype)
    for k in range(0, elongations.shape[-1], PART):
        some = slice(k, k + PART)
        if functions.own(bonds.laws):
            elongations[..., some] = _of_ends(
                bonds, "pair", u, np.arange(len(contacts.first))[some]
            )[0][..., 0]
            continue
        pair = contacts.kind[some] == PAIR
        w = _between(u, contacts.first[some], contacts.second[some], pair)
        all_in_one = elongations.shape[-1] <= PART
        geometry = contacts.geometry if all_in_one else contacts.geometry_of(some)
        elongations[..., some] = _elongations_at(bonds, geometry, pair, w)
    return averaged(bonds, elongations)


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
    return averaged(bonds, np.sum(along * _between(of, first, second, pair), axis=-1))


def _between(u, first, second, pair):
    """Displacement of the second end of each bond from the first, or from a wall."""
    return u[..., second, :] - np.where(pair[:, None], u[..., np.where(pair, first, 0), :], 0)


def _of_ends(bonds, kind, u, members=None, ends=None, y=None):
    """Results, (..., members, size) each, of a function of the law of both ends.

    Parameters
    ----------
    bonds : Bonds
    kind : str
        A key of `PairForms.functions`.
    u : ndarray, (..., rows, dim)
        Displacements [m].
    members : ndarray of int, optional
        Numbers of the bonds; by default all.
    ends : tuple of ndarray of int, optional
        The rows of u at which they end.
    y : ndarray, (..., members, 2 dim), optional
        A further argument.
    """
    of, group = bonds.contacts, bonds.group if members is None else bonds.group[members]
    if ends is None:
        ends = [x if members is None else x[members] for x in (of.first, of.second)]
    law, states = functions.own(bonds.laws), (*u.shape[:-2], len(group))
    p = np.broadcast_to(bonds.parameters[group], (*states, bonds.parameters.shape[1]))
    given = [*(u[..., end, :] for end in ends), p, *([] if y is None else [y])]
    columns = [x.reshape(math.prod(states), -1).T for x in given]
    outputs = law.functions()[kind].map(max(columns[0].shape[1], 1)).call(columns)
    sizes = [math.prod(law.functions()[kind].size_out(k)) for k in range(len(outputs))]
    flat = [np.array(x).ravel(order="F") for x in outputs]  # columns one after the other
    return [x.reshape(*states, size) for x, size in zip(flat, sizes, strict=True)]


def _elongations_at(bonds, geometry, pair, w):
    """Elongations for relative displacements w of the ends, (..., bonds, dim)."""
    reference, gap, length = geometry[:-2], geometry[-2], geometry[-1]
    r = gap + np.sum(reference.T * w, axis=-1)  # walls, and on a line
    dim = len(reference)
    if dim > 1:
        axes = (*reference[:, pair], *np.moveaxis(w[..., pair, :], -1, 0))
        (r[..., pair],) = run(derived(_elongation, dim), np, (*axes, gap[pair], length[pair]))
    return r


def _along(bonds, geometry, pair, w):
    """Gradient of the elongations with respect to w: unit vectors of pairs, normals of walls."""
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
    ends = int(bonds.stretch is None)  # a ring has as many sites as bonds
    return len(bonds.group) + ends if bonds.contacts is None else bonds.contacts.rows


def scattered_forces(bonds, tension, along):
    """Forces of bonds on the rows.

    Parameters
    ----------
    bonds : Bonds
    tension : ndarray, (..., bonds)
        [N]
    along : ndarray, (..., bonds, dim) or (..., bonds, 2 dim)
        Gradient of the elongations; see `elongations`.

    Returns
    -------
    ndarray, (..., rows, dim)
        [N]
    """
    each = tension[..., None] * along
    each, other = _at_ends(bonds, each)
    return scattered(*connectivity(bonds)[:2], each, _rows(bonds), other)


def _at_ends(bonds, each):
    """What is added at first and subtracted at second ends, from products with the gradient."""
    if functions.own(bonds.laws):
        first, second = np.split(each, 2, axis=-1)
        return -first, second
    return each, each


def scattered(first, second, each, rows, other=None):
    """Vectors of bonds added at their first ends, and these or others subtracted at their second
    ends.

    Parameters
    ----------
    first, second : ndarray of int, (bonds,)
        Rows of the ends.
    each : ndarray, (..., bonds, dim)
    rows : int
    other : ndarray, shape of `each`, optional

    Returns
    -------
    ndarray, (..., rows, dim)
    """
    sums = np.zeros((*each.shape[:-2], rows, each.shape[-1]), dtype=each.dtype)
    by_row = np.moveaxis(sums, -2, 0)  # a view
    np.add.at(by_row, first, np.moveaxis(each, -2, 0))
    np.subtract.at(by_row, second, np.moveaxis(each if other is None else other, -2, 0))
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
        Displacements [m], of which only a law of both ends makes use.

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]; the columns of walls are 0, as walls do not move.
    """
    first, second, pair, geometry = connectivity(bonds)
    if functions.own(bonds.laws):
        (blocks,) = _of_ends(bonds, "tangent", u)
        return assembled(
            first, second, blocks.reshape(len(first), along.shape[1], -1), _rows(bonds)
        )
    refuse_cables(bonds, "the tangent stiffness of a network")
    blocks = tangents(along, stiffness, _density(geometry, pair, r, tension))
    return assembled(first, second, of_both_ends(blocks), _rows(bonds), pair)


def refuse_cables(bonds, what):
    """Refuse what is not made for cables over sites."""
    if bonds.cable is not None:
        raise TensegrityError(f"{what}: not for cables over sites, whose structure has modes")


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


def of_both_ends(blocks):
    """Tangent stiffness by the coordinates of both ends, (bonds, 2 dim, 2 dim), of bonds with that
    by their difference, (bonds, dim, dim)."""
    return np.block([[blocks, -blocks], [-blocks, blocks]])


def assembled(first, second, blocks, rows, pair=slice(None)):
    """Tangent stiffness of all bonds as one sparse matrix.

    Parameters
    ----------
    first, second : ndarray of int, (bonds,)
        Rows of the ends.
    blocks : ndarray, (bonds, 2 dim, 2 dim)
        Tangent stiffness of each bond by both ends [N/m].
    rows : int
    pair : ndarray of bool, (bonds,), optional
        Bonds whose first end is a site; the others end at walls, which do not move.

    Returns
    -------
    scipy.sparse.coo_array, (rows dim, rows dim)
        [N/m]
    """
    from scipy.sparse import coo_array

    dim = blocks.shape[-1] // 2
    axis, at, to, values, ends = np.arange(dim), [], [], [], (first, second)
    for row, column in ((1, 1), (0, 1), (0, 0), (1, 0)):
        members = slice(None) if column else pair
        matrix = blocks[members, dim * row : dim * (row + 1), dim * column : dim * (column + 1)]
        i, j = (dim * ends[x][members][:, None, None] for x in (row, column))
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
        self.members, self._rows, self._bonds, self._u = members, len(rows), layout.bonds, u
        self._ends = first, second = tuple(place[x[members]] for x in layout.ends)
        self._wanted = layout.wanted
        _, _, pair, geometry = connectivity(layout.bonds)
        pair, geometry = pair[members], geometry[:, members]
        if functions.own(layout.bonds.laws):
            self.r, self._along = self._of_ends("pair")
            self.r = self.r[..., 0]
        else:
            w, of = _between(u, first, second, pair), layout.bonds
            self.r, self._along = (
                _elongations_at(of, geometry, pair, w),
                _along(of, geometry, pair, w),
            )
        self.f, self.k, self._d = layout.laws_at(self.r, members)
        self._density = _density(geometry, pair, self.r, self.f)

    def _of_ends(self, kind, y=None):
        return _of_ends(self._bonds, kind, self._u, self.members, self._ends, y)

    def _wanted_of(self, by_all):
        """Derivatives by the requested parameters, (wanted, ...), of those by all, (..., all)."""
        return np.moveaxis(by_all[..., list(self._wanted[0])], -1, 0)

    def forces(self):
        """Forces on the rows [N], shape of u."""
        return self._scattered(self.f[..., None] * self._along)

    def _scattered(self, each):
        each, other = _at_ends(self._bonds, each)
        return scattered(*self._ends, each, self._rows, other)

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
        along, turned, by_p, of_ends = self._along, 0.0, 0.0, functions.own(self._bonds.laws)
        if of_ends and np.any(by_elongation):
            by_p = by_elongation * self._wanted_of(self._of_ends("slopes")[0])
        if by_force is not None:
            first, second = (by_force[..., end, :] for end in self._ends)
            if of_ends:
                (both,) = self._of_ends("turned", -np.concatenate([first, second], axis=-1))
                turned, rest = np.split(both, [along.shape[-1]], axis=-1)
                by_p = by_p + self._wanted_of(rest)
            else:
                lengthwise = np.sum((first - second) * along, axis=-1)
                by_tension = by_tension + lengthwise
                turned = self._density[..., None] * (first - second - lengthwise[..., None] * along)
        g = by_tension * self.k + by_elongation
        return -self._scattered(g[..., None] * along + turned), by_tension * self._d + by_p, g
