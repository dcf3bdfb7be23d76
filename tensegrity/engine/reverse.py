"""The loop backwards: what a run did undone, stage by stage, with derivatives carried along.

A stage of a splitting can be undone from its result, so the derivatives of what was computed need
no states kept: the adjoint of each stage is done where the stage is undone.  A method's rows are
those of `methods.Splitting`; what runs is the C of `reverse.c`.
"""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from tensegrity.engine.bonds import PAIR, WALL, integers, parameters
from tensegrity.engine.bound import Bound, stages
from tensegrity.engine.codegen import reverse_text
from tensegrity.engine.native import library, structure
from tensegrity.once import once

SCENE = structure("reverse.c", "scene")
COTANGENTS = structure("reverse.c", "cotangents")
PACK = 8  # numbers that C may write or read behind the last


@once
def _compiled(laws, own, wanted, dim, exact):
    flags = [f"-DDIM={dim}"] if dim else []
    return library(reverse_text(laws, own, wanted, dim, exact), flags)


class Layout:
    """Bonds as the loop backwards takes them, in the runs of the loop, and what it wants to know.

    Parameters
    ----------
    bonds : Bonds
    wanted : tuple of tuple of int
        For each law the numbers of the parameters by which derivatives are wanted.
    exact : bool
        Whether states are whole units of a grid.

    Attributes
    ----------
    dim, sites : int
        Coordinates of a site in a network, 0 on a line; number of sites.
    rows : int
        Of the arrays: sites, and in a network one that stands for all walls; on a line whole packs,
        and one behind them.
    shape : tuple of int
        Of u, v and what belongs to them.
    room : int
        Places of bonds, and room for what C may write behind the last.
    most : int
        Most parameters wanted of any law.
    kind : ndarray of int, (bonds,)
        Index into `bonds.KINDS`.
    ends : tuple of ndarray of int
        Rows of both ends of each bond, that of the walls for a wall.
    place : ndarray of int, (bonds,)
        Where each bond is among the places of the loop.
    """

    def __init__(self, bonds, wanted, exact=False):
        self.bonds, self.wanted, self._exact = bonds, wanted, exact
        source, contacts, count = bonds.runs.source, bonds.contacts, len(bonds.group)
        self.dim, self.sites = bonds.dim, len(bonds.inverse_mass)
        packs = -(-self.sites // PACK) * PACK
        self.rows = self.sites + 1 if self.dim else packs + PACK
        self.shape = (self.rows, self.dim) if self.dim else (self.rows,)
        self.room = max(len(source), 0 if self.dim else self.rows) + PACK
        self.most = max((len(x) for x in wanted), default=0)
        self.kind, self.ends = np.full(count, PAIR), (np.arange(count), np.arange(count) + 1)
        if contacts is not None:
            self.kind = contacts.kind
            self.ends = np.where(self.kind == WALL, self.sites, contacts.first), contacts.second
        self.place = np.argsort(source)

    @cached_property
    def library(self):
        """The compiled text."""
        b = self.bonds
        return _compiled(b.laws, b.own, self.wanted, self.dim, self._exact)

    def parameters(self, bonds):
        """Fields of a scene: `bonds.parameters`."""
        return parameters(bonds, self.bonds.runs, self.bonds.own)

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


class Back:
    """Derivatives of objectives, carried backwards through a run.

    Parameters
    ----------
    layout : Layout
    method : Splitting
    dt : float
        [s]
    totals : Totals
        What is added up, by all that carry derivatives of one run.
    grid : (float, float), optional
        What rounds moves of u and of v.

    Attributes
    ----------
    u, v : ndarray, (rows[, dim])
        Where the run is.
    ub, vb : ndarray, (objectives, rows[, dim])
        Derivatives by these.
    scene : Structure
    """

    def __init__(self, layout, method, dt, totals, grid=(0.0, 0.0)):
        self.layout, self._totals = layout, totals
        b, dim, runs, room = layout.bonds, layout.dim, layout.bonds.runs, layout.room
        n, sites, size = len(runs.source), layout.sites, max(dim, 1)
        self.u, self.v, w, load = np.zeros((4, *layout.shape))
        self.ub, self.vb = np.zeros((2, totals.objectives, *layout.shape))
        w[:sites] = b.inverse_mass[:, None] if dim else b.inverse_mass
        place = np.zeros((2, n))
        if dim:
            load[:sites] = b.contacts.load
            place = np.ascontiguousarray(b.contacts.geometry[:, runs.source])
        entries, (first, second) = self.u.size, (size * x[runs.source] for x in layout.ends)
        where = {"from": first, "to": second, "first": runs.first}
        where |= {"law": 2 * runs.law + runs.own, "wall": runs.kind == WALL}
        scratch = {"r": room, "f": room + 2, "k": room, "bent": room, "d": (layout.most, room)}
        scratch |= {"along": (dim, n), "pull": entries, "turn": entries}
        scratch |= {"low": n, "high": n, "travel": 1}
        self.scene = SCENE(
            **stages(method, dt),
            **layout.parameters(b),
            **{name: integers(x) for name, x in where.items()},
            **{name: np.zeros(size) for name, size in scratch.items()},
            u=self.u,
            v=self.v,
            w=w,
            ub=self.ub,
            vb=self.vb,
            load=load,
            geometry=place,
            grid=np.array(grid),
            wb=totals.arrays[0],
            pb=totals.arrays[1],
            gb=totals.arrays[2],
            runs=len(runs.law),
            bonds=n,
            entries=entries,
            apart=room,
            moving=sites * size,
            objectives=totals.objectives,
            wanted=layout.most,
            room=entries if dim else entries - PACK,
        )
        self._address = ctypes.addressof(self.scene)

    def retune(self, bonds):
        """Begin anew with the masses and parameters of other bonds, in the same runs of a line.

        Derivatives and totals are 0 then.
        """
        self.scene.filled["w"][: self.layout.sites] = bonds.inverse_mass
        for name, values in self.layout.parameters(bonds).items():
            self.scene.filled[name][:] = values
        for array in (self.ub, self.vb, *self._totals.arrays):
            array[:] = 0

    def set(self, u, v):
        """Take a state, (sites[, dim])."""
        self.u[: self.layout.sites], self.v[: self.layout.sites] = u, v

    def state(self):
        """Copies of u and v, (sites[, dim])."""
        return self.u[: self.layout.sites].copy(), self.v[: self.layout.sites].copy()

    def reverse(self, steps, last, cotangents=None, opened=True):
        """Undo steps.

        Parameters
        ----------
        steps, last : int
            How many, and the number of the last of them.
        seeds : Seeds, optional
            What objectives have to do with the states between, that before the steps included.
        opened : bool, optional
            Whether the first of them has the closing kick of the step before in it; the last
            has not its own.
        """
        given = None if cotangents is None else cotangents.address
        self.layout.library.reverse(self._address, steps, opened, last, given)

    def add_cotangents(self, cotangents, k):
        """Add what objectives have to do with the state after step number k."""
        self.layout.library.add_cotangents(self._address, cotangents.address, k)


class OnGrid(Bound):
    """A scene whose moves are rounded to whole units of a grid, so that steps can be undone to the
    last bit; as `Bound`, without rows behind the sites.

    Parameters
    ----------
    layout : Layout
    u, v : ndarray, (rows[, dim])
    method : Splitting
    dt : float
        [s]
    grid : (float, float)
        What rounds moves of u and of v.
    """

    def __init__(self, layout, u, v, method, dt, grid):
        back = Back(layout, method, dt, Totals(layout, 0), grid)
        self._bonds, self._scene, self._second = layout.bonds, back.scene, None
        self._low, self._high, self._travel = (
            back.scene.filled[name] for name in ("low", "high", "travel")
        )
        self._seen, self._springs, self._each = layout.place, layout.bonds.group, False
        self._sites, self.sizes = layout.sites, (layout.sites * max(layout.dim, 1), 0)
        self._advance, self._show = layout.library.advance, layout.library.show
        self.u, self.v, self.shown = back.u, back.v, (back.u.copy(), back.v.copy())
        self._march, self._inner = self._marched(self._advance), (back.u, back.v, *self.shown)
        self.u, self.v, self.shown = u, v, (u.copy(), v.copy())
        self.forget_range()

    def go(self, done, end, wanted=()):
        """As `Bound.go`."""
        outer, sites = (self.u, self.v, *self.shown), self._sites
        for mine, given in zip(self._inner[:2], outer, strict=False):
            mine[:sites] = given[:sites]
        stopped = super().go(done, end, wanted)
        for mine, given in zip(self._inner, outer, strict=True):
            given[:sites] = mine[:sites]
        return stopped

    def advance_open(self, steps, opened):
        """As `Bound.advance_open`."""
        self.go(int(opened), int(opened) + steps)


class Totals:
    """What a pass backwards adds up.

    Attributes
    ----------
    arrays : tuple of ndarray
        All of them, as the loop has them.
    """

    def __init__(self, layout, objectives):
        self.objectives, self._layout = objectives, layout
        self.arrays = (
            np.zeros((objectives, *layout.shape)),
            np.zeros((objectives, layout.most, layout.room)),
            np.zeros((objectives, len(layout.bonds.runs.source))),
        )

    @property
    def w(self):
        """Derivatives by the inverse mass of every entry; (objectives, sites[, dim])."""
        return self.arrays[0][:, : self._layout.sites]

    @property
    def p(self):
        """By the parameters; (objectives, wanted, bonds)."""
        return self.arrays[1][..., self._layout.place]

    @property
    def g(self):
        """By the elongations, in a network; (objectives, bonds)."""
        return self.arrays[2][:, self._layout.place]


class OutputCotangents:
    """What objectives have to do with the states of a run, at some of its entries.

    Parameters
    ----------
    rows : ndarray, (objectives, steps, places)
    places : ndarray of int
        Entries of u, and behind them of v.
    of_u : int
        How many are of u.
    begin : int
        The step of the first row.
    """

    def __init__(self, rows, places, of_u, begin):
        self._structure = COTANGENTS(
            rows=np.ascontiguousarray(rows, dtype=float),
            places=integers(places),
            count=len(places),
            of_u=of_u,
            begin=begin,
            end=begin + rows.shape[1] - 1,
        )
        self.address = ctypes.addressof(self._structure)
