"""Bonds in the order of the loop backwards, and what it wants to know of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensegrity.engine import reverse_text
from tensegrity.engine.bonds import PAIR, WALL, Bonds

PACK = 8  # numbers that C may write or read behind the last


@dataclass(frozen=True, eq=False)
class Layout:
    """Bonds in the order of the loop backwards, and what it wants to know of them.

    Attributes
    ----------
    bonds : Bonds
    wanted : tuple of tuple of int
        For each law the numbers of the parameters by which derivatives are wanted.
    exact : bool
        Whether states are whole units of a grid.
    """

    bonds: Bonds
    wanted: tuple
    exact: bool = False

    @property
    def dim(self):
        """Coordinates of a site in a network, 0 on a line."""
        return self.bonds.dim

    @property
    def sites(self):
        """Number of sites."""
        return len(self.bonds.inverse_mass)

    @property
    def rows(self):
        """Rows of the arrays: sites, and in a network one that stands for all walls.

        On a line whole packs, and one behind them.
        """
        return self.sites + 1 if self.dim else -(-self.sites // PACK) * PACK + PACK

    @property
    def shape(self):
        """Shape of u, v and what belongs to them."""
        return (self.rows, self.dim) if self.dim else (self.rows,)

    @property
    def room(self):
        """Bonds, and room for what C may write behind the last."""
        return max(len(self.bonds.group), 0 if self.dim else self.rows) + PACK

    @property
    def most(self):
        """Most parameters wanted of any law."""
        return max((len(x) for x in self.wanted), default=0)

    @cached_property
    def kind(self):
        """Index into `bonds.KINDS` of each bond."""
        contacts = self.bonds.contacts
        return np.full(len(self.bonds.group), PAIR) if contacts is None else contacts.kind

    @cached_property
    def ends(self):
        """Rows of both ends of each bond, that of the walls for a wall."""
        contacts = self.bonds.contacts
        if contacts is None:
            first = np.arange(len(self.bonds.group))
            return first, first + 1
        return np.where(self.kind == WALL, self.sites, contacts.first), contacts.second

    @cached_property
    def order(self):
        """The bond at each place: runs of one law, and in a network of one kind."""
        if self.bonds.contacts is None:
            return np.arange(len(self.bonds.group))
        return np.argsort(2 * self.bonds.law_of_bond + self.kind, kind="stable")

    @cached_property
    def first(self):
        """First place of each run, and behind them the number of bonds."""
        if self.bonds.contacts is None:
            return np.asarray(self.bonds.runs.first)
        key = (2 * self.bonds.law_of_bond + self.kind)[self.order]
        return np.concatenate([[0], np.flatnonzero(np.diff(key)) + 1, [len(key)]])[: len(key) + 1]

    def _groups(self, run):
        """Of each bond of a run."""
        return self.bonds.group[self.order[self.first[run] : self.first[run + 1]]]

    @cached_property
    def run_own(self):
        """Whether the bonds of each run have parameters of their own; (runs,)."""
        if self.bonds.contacts is None:
            return np.asarray(self.bonds.runs.own)
        runs = map(self._groups, range(len(self.first) - 1))
        return np.array([int(np.any(groups != groups[0])) for groups in runs], dtype=int)

    @cached_property
    def run_law(self):
        """Number of the law of each run; (runs,)."""
        return self.bonds.law_of_bond[self.order[self.first[:-1]]]

    @cached_property
    def own(self):
        """For each law the numbers of the parameters that differ within a run, or None."""
        found = [None] * len(self.bonds.laws)
        for k in np.flatnonzero(self.run_own):
            values = self.bonds.parameters[np.unique(self._groups(k))]
            law = self.run_law[k]
            differ = np.flatnonzero(np.any(values != values[0], axis=0)).tolist()
            found[law] = tuple(sorted({*differ, *(found[law] or ())}))
        return tuple(found)

    @cached_property
    def library(self):
        """The compiled text."""
        b = self.bonds
        return reverse_text.compiled(b.laws, self.own, self.wanted, self.dim, self.exact)

    def parameters(self, bonds):
        """Fields of a scene: parameters that bonds of a run share, `shared`, those of their
        `own`, and where these begin, `own_at`."""
        most = max((len(law.parameters) for law in self.bonds.laws), default=0)
        shared, own, at = np.zeros((len(self.run_law), most)), [np.zeros(0)], [0]
        for k, law in enumerate(self.run_law):
            groups = self._groups(k)
            shared[k] = bonds.parameters[groups[0], :most]
            if self.run_own[k]:
                own.append(bonds.parameters[groups][:, list(self.own[law])].T.ravel())
            at.append(at[-1] + (own[-1].size if self.run_own[k] else 0))
        own = np.concatenate([*own, np.zeros(PACK)])
        return {"shared": shared, "own": own, "own_at": np.array(at[:-1], dtype=np.int64)}

    def laws_at(self, r, members):
        """Tension, stiffness, and derivatives by what is wanted, of some bonds.

        Parameters
        ----------
        r : ndarray, (..., members)
        members : ndarray of int

        Returns
        -------
        f, k : ndarray, (..., members)
        d : ndarray, (most wanted, ..., members)
        """
        f, k, d = np.empty(r.shape), np.empty(r.shape), np.zeros((self.most, *r.shape))
        for group in np.unique(self.bonds.group[members]):
            mine = np.flatnonzero(self.bonds.group[members] == group)
            law = int(self.bonds.law[group])
            count = len(self.wanted[law])
            flat = np.ascontiguousarray(r[..., mine]).ravel()
            p = np.ascontiguousarray(self.bonds.parameters[group])
            room = flat.size + PACK
            found, flat = np.empty((2 + count, room)), np.append(flat, np.zeros(PACK))
            places = [x.ctypes.data for x in (p, flat, found[0], found[1])]
            places.append(found.ctypes.data + 2 * found.strides[0])
            self.library.evaluate(law, room - PACK, room, *places)
            found = found[:, :-PACK].reshape(-1, *r.shape[:-1], len(mine))
            f[..., mine], k[..., mine], d[:count, ..., mine] = found[0], found[1], found[2:]
        return f, k, d
