"""Bonds in NumPy at many states at once, with derivatives carried back through them."""

from __future__ import annotations

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import PAIR


class Pulled:
    """Some bonds in NumPy, at many states at once, and derivatives carried back through them.

    Parameters
    ----------
    layout : Layout
    members : ndarray of int
        Numbers of the bonds.
    rows : sequence of int
        The rows that arrays have, in their order.
    """

    def __init__(self, layout, members, rows):
        self._layout, self.members = layout, members
        self._pair = layout.kind[members] == PAIR
        place = np.full(layout.rows, -1)
        place[rows] = np.arange(len(rows))
        self._first, self._second = (place[x[members]] for x in layout.ends)

    def at(self, u):
        """Take displacements (..., rows[, dim]); the row of walls, if any, is 0."""
        self._u, layout = u, self._layout
        dim = layout.dim
        if not dim:
            self.r = u[..., self._second] - u[..., self._first]
            self.along = np.ones((*self.r.shape, 1))
        else:
            moved = np.where(self._pair[:, None], u[..., self._first, :], 0.0)
            self.r, self.along = _placed(layout, self.members, u[..., self._second, :] - moved)
        self.f, self.k, self.d = layout.laws_at(self.r, self.members)

    def forces(self):
        """Forces on the rows, shape of u."""
        found = np.zeros((*self._u.shape[: self.r.ndim - 1], *self._rows()))
        self._add(found, self.f[..., None] * self.along)
        return found.reshape(self._u.shape)

    def _rows(self):
        dim = self._layout.dim
        return self._u.shape[self.r.ndim - 1 :] if dim else (*self._u.shape[self.r.ndim - 1 :], 1)

    def _add(self, found, each):
        """What pulls at the first end, with its sign turned at the second; rows of -1 are not."""
        by_row, each = np.moveaxis(found, -2, 0), np.moveaxis(each, -2, 0)
        for rows, add in ((self._first, np.add.at), (self._second, np.subtract.at)):
            there = rows >= 0
            add(by_row, rows[there], each[there])

    def back(self, by_force=None, by_tension=None, by_elongation=None):
        """From derivatives by forces on rows, tensions and elongations of bonds to those by u.

        Each has the shape of what it belongs to, perhaps with further axes before.

        Returns
        -------
        ub : ndarray, shape of u
        p : ndarray, (wanted, ..., members)
            By the parameters wanted, summed over nothing.
        g : ndarray, (..., members)
            By the elongation.
        """
        dim, along = self._layout.dim, self.along
        t, turned = (0.0 if by_tension is None else by_tension), 0.0
        if by_force is not None:
            y = by_force if dim else by_force[..., None]
            y = _taken(y, self._first) - _taken(y, self._second)
            t = t + np.sum(y * along, axis=-1)
            if dim > 1:
                length = self._layout.bonds.contacts.geometry[-1][self.members]
                across = np.where(self._pair, self.f / np.where(self._pair, length + self.r, 1), 0)
                lengthwise = np.sum(y * along, axis=-1, keepdims=True) * along
                turned = across[..., None] * (y - lengthwise)
        g = t * self.k + (0.0 if by_elongation is None else by_elongation)
        pulls = g[..., None] * along + turned
        found = np.zeros((*g.shape[:-1], *self._rows()))
        self._add(found, -pulls)
        d = self.d.reshape(len(self.d), *[1] * (g.ndim - self.r.ndim), *self.r.shape)
        return (found if dim else found[..., 0]), t * d, g


def _taken(y, rows):
    """Rows of y (..., rows, dim), 0 where there is none."""
    return np.where((rows >= 0)[:, None], y[..., rows, :], 0.0)


def _placed(layout, members, w):
    """Elongations and their gradients, for differences of displacements w (..., members, dim)."""
    dim, contacts = layout.dim, layout.bonds.contacts
    r, along = np.empty(w.shape[:-1]), np.empty(w.shape)
    for number, kind in enumerate(("pair", "wall")):
        mine = np.flatnonzero(layout.kind[members] == number)
        if not mine.size:
            continue
        place = contacts.geometry[:, members[mine]]
        flat = w[..., mine, :].reshape(-1, dim)
        times = len(flat) // len(mine)
        wide = np.tile(place, times)
        function = geometry.functions(dim)[kind]
        found = function(wide[:dim], flat.T, wide[None, dim], wide[None, dim + 1])
        shape = *w.shape[:-2], len(mine)
        r[..., mine] = np.array(found[0]).reshape(shape)
        along[..., mine, :] = np.array(found[1]).T.reshape(*shape, dim)
    return r, along
