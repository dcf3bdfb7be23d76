"""The loop backwards: what a run did undone, stage by stage, with derivatives carried along.

A stage of a splitting can be undone from its result, so the derivatives of what was computed need
no states kept: the adjoint of each stage is done where the stage is undone.  A method's rows are
those of `methods.Splitting`; what runs is the C of `reverse_*.c`, or without a compiler the same
in NumPy.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensegrity.engine import reverse_text
from tensegrity.engine.bonds import PAIR, WALL, Bonds, by_spring
from tensegrity.engine.pulled import Pulled


def _structure(name, addresses, counts):
    fields = [(field, ctypes.c_void_p) for field in addresses.split()]
    fields += [(field, ctypes.c_longlong) for field in counts.split()]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_SCENE = _structure(  # as in reverse.h
    "_Scene",
    "u v w load shared own geometry kicks drifts grid ub vb wb pb gb r f k d along pull turn bent "
    "low high travel at to first law wall own_at",
    "runs bonds entries moving objectives wanted stages closing room apart",
)
_SEEDS = _structure("_Seeds", "rows places", "count of_u begin end")
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

    @cached_property
    def run_own(self):
        """Whether the bonds of each run have parameters of their own; (runs,)."""
        if self.bonds.contacts is None:
            return np.asarray(self.bonds.runs.own)
        groups = self.bonds.group[self.order]
        parts = zip(self.first[:-1], self.first[1:], strict=True)
        return np.array([int(np.any(groups[a:b] != groups[a])) for a, b in parts], dtype=int)

    @cached_property
    def run_law(self):
        """Number of the law of each run; (runs,)."""
        return self.bonds.law_of_bond[self.order[self.first[:-1]]]

    @cached_property
    def own(self):
        """For each law the numbers of the parameters that differ within a run, or None."""
        found = [None] * len(self.bonds.laws)
        for k in np.flatnonzero(self.run_own):
            groups = np.unique(self.bonds.group[self.order[self.first[k] : self.first[k + 1]]])
            values = self.bonds.parameters[groups]
            law = self.run_law[k]
            differ = np.flatnonzero(np.any(values != values[0], axis=0)).tolist()
            found[law] = tuple(sorted({*differ, *(found[law] or ())}))
        return tuple(found)

    @cached_property
    def library(self):
        """The compiled text, or None."""
        b = self.bonds
        return reverse_text.compiled(b.laws, self.own, self.wanted, self.dim, self.exact)

    def parameters(self, bonds):
        """Those that bonds of a run share, those of their own, and where these begin."""
        most = max((len(law.parameters) for law in self.bonds.laws), default=0)
        shared, own, at = np.zeros((len(self.run_law), most)), [np.zeros(0)], [0]
        for k, law in enumerate(self.run_law):
            groups = self.bonds.group[self.order[self.first[k] : self.first[k + 1]]]
            shared[k] = bonds.parameters[groups[0], :most]
            if self.run_own[k]:
                own.append(bonds.parameters[groups][:, list(self.own[law])].T.ravel())
            at.append(at[-1] + (own[-1].size if self.run_own[k] else 0))
        return shared, np.concatenate([*own, np.zeros(PACK)]), np.array(at[:-1], dtype=np.int64)

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
            if self.library is not None:
                room = flat.size + PACK
                found, flat = np.empty((2 + count, room)), np.append(flat, np.zeros(PACK))
                places = [x.ctypes.data for x in (p, flat, found[0], found[1])]
                places.append(found.ctypes.data + 2 * found.strides[0])
                self.library.evaluate(law, room - PACK, room, *places)
                found = found[:, :-PACK]
            else:
                function = reverse_text.law_function(self.bonds.laws[law], self.wanted[law])
                found = np.array(function(flat[None], p[: function.size1_in(1)]))
            found = found.reshape(-1, *r.shape[:-1], len(mine))
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
    """

    def __init__(self, layout, method, dt, totals, grid=(0.0, 0.0)):
        self.layout, self._method, self._dt, self._totals = layout, method, dt, totals
        b, dim, n, room = layout.bonds, layout.dim, len(layout.bonds.group), layout.room
        shape = (layout.rows, dim) if dim else (layout.rows,)
        self.u, self.v = np.zeros((2, *shape))
        self.ub, self.vb = np.zeros((2, totals.objectives, *shape))
        self._w = weights(layout)
        if layout.library is None:
            return
        load = np.zeros(shape)
        place = np.zeros((dim + 2, n))
        if dim:
            load[: layout.sites] = b.contacts.load
            place = np.ascontiguousarray(b.contacts.geometry[:, layout.order])
        shared, own, own_at = layout.parameters(b)
        kicks = np.multiply(method.kicks, dt)
        at, to = (max(dim, 1) * x[layout.order] for x in layout.ends)
        entries = self.u.size
        filled = entries if dim else entries - PACK
        self._low, self._high, self._travel = np.empty(n), np.empty(n), np.zeros(1)
        self.forget_range()
        numbers = [
            self.u, self.v, self._w, load, shared, own, place, kicks,
            np.multiply(method.drifts, dt), np.array(grid), self.ub, self.vb, totals.whole_w,
            totals.whole_p, totals.g, np.zeros(room), np.zeros(room + 2), np.zeros(room),
            np.zeros((layout.most, room)), np.zeros((dim, n)), np.zeros(entries),
            np.zeros(entries), np.zeros(room), self._low, self._high, self._travel,
            *(np.asarray(x, dtype=np.int64) for x in (
                at, to, layout.first, 2 * layout.run_law + layout.run_own,
                layout.kind[layout.order[layout.first[:-1]]] == WALL, own_at)),
        ]  # fmt: skip
        self._arrays = [np.ascontiguousarray(x) for x in numbers]
        counts = len(layout.run_law), n, entries, layout.sites * max(dim, 1), totals.objectives
        counts += layout.most, method.stages, int(kicks[-1] != 0), filled, room
        self._structure = _SCENE(*(x.ctypes.data for x in self._arrays), *counts)
        self._address = ctypes.addressof(self._structure)

    def retune(self, bonds):
        """Begin anew with the masses and parameters of other bonds, in the same runs of a line.

        Derivatives and totals are 0 then.
        """
        shared, own, _ = self.layout.parameters(bonds)
        self._arrays[2][: self.layout.sites] = bonds.inverse_mass
        for k, values in ((4, shared), (5, own)):
            self._arrays[k][:] = values
        totals = self._totals
        for array in (self.ub, self.vb, totals.w, totals.p, totals.g):
            array[:] = 0

    def set(self, u, v):
        """Take a state, (sites[, dim])."""
        self.u[: self.layout.sites], self.v[: self.layout.sites] = u, v

    def state(self):
        """Copies of u and v, (sites[, dim])."""
        return self.u[: self.layout.sites].copy(), self.v[: self.layout.sites].copy()

    def reverse(self, steps, last, seeds=None, opened=True, close=False):
        """Undo steps.

        Parameters
        ----------
        steps, last : int
            How many, and the number of the last of them.
        seeds : Seeds, optional
            What objectives have to do with the states between, that before the steps included.
        opened, close : bool, optional
            Whether the first of them has the closing kick of the step before in it, and whether
            the last has its own.
        """
        if self.layout.library is not None:
            given = None if seeds is None else seeds.address
            self.layout.library.reverse(self._address, steps, opened, close, last, given)
            return
        kicks, drifts = (
            np.multiply(x, self._dt) for x in (self._method.kicks, self._method.drifts)
        )
        if close and kicks[-1]:
            self._stage(kicks[-1], 0.0)
        for k in range(steps - 1, -1, -1):
            for i in range(len(drifts) - 1, -1, -1):
                merged = (k > 0 or opened) and i == 0
                self._stage(kicks[i] + (kicks[-1] if merged else 0.0), drifts[i])
            if seeds is not None:
                self.sow(seeds, last - (steps - k))

    def sow(self, seeds, k):
        """Add what objectives have to do with the state after step number k."""
        if self.layout.library is not None:
            self.layout.library.sow(self._address, seeds.address, k)
        elif seeds.begin <= k <= seeds.end:
            row, of_u = seeds.rows[:, k - seeds.begin], seeds.of_u
            for array, places, part in (
                (self.ub, seeds.places[:of_u], row[:, :of_u]),
                (self.vb, seeds.places[of_u:], row[:, of_u:]),
            ):
                array.reshape(len(row), -1)[:, places] += part

    def _stage(self, a, b):
        """As `reverse_stage` in C."""
        pulled, totals, w = self.pulled, self._totals, self._w
        self.u -= b * self.v
        self.vb += b * self.ub
        if a == 0:
            return
        pulled.at(self.u)
        force = pulled.forces()
        if self.layout.dim:
            force[: self.layout.sites] += self.layout.bonds.contacts.load
        self.v -= a * w * force
        totals.whole_w += a * self.vb * force
        ub, p, g = pulled.back(by_force=a * w * self.vb)
        self.ub += ub
        totals.p += p[..., self.layout.order].transpose(1, 0, 2)
        totals.g += g[..., self.layout.order]

    @cached_property
    def pulled(self):
        """The bonds in NumPy."""
        return Pulled(self.layout)

    # forwards, on a grid

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:], self._travel[:] = np.inf, -np.inf, 0

    def advance(self, steps):
        """Do whole steps, each move rounded to whole units of the grid."""
        self.layout.library.advance(self._address, steps)

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`."""
        b = self.layout.bonds
        return by_spring(b.group[self.layout.order], len(b.law), self._low, self._high)

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]."""
        return float(self._travel[0])

    def sample(self, steps, places, of_u, rows):
        """Do steps one by one, keeping entries of u and v after each."""
        lib, arrays = self.layout.library, (x.ctypes.data for x in (self.u, self.v, places))
        step = _pointer(lib.advance), self._address
        lib.sampled(*step, steps, *arrays, len(places), of_u, rows.ctypes.data)


def weights(layout):
    """Inverse mass of every entry [1/kg]."""
    w = np.asarray(layout.bonds.inverse_mass, dtype=float)
    found = np.zeros((layout.rows, layout.dim) if layout.dim else layout.rows)
    found[: layout.sites] = w[:, None] if layout.dim else w
    return found


class Totals:
    """What a pass backwards adds up.

    Attributes
    ----------
    w : ndarray, (objectives, rows[, dim]), on a line (objectives, sites)
        Derivatives by the inverse mass of every entry.
    p : ndarray, (objectives, wanted, bonds)
        By the parameters; bonds in the order of the layout.
    g : ndarray, (objectives, bonds)
        By the elongations, in a network.
    """

    def __init__(self, layout, objectives):
        shape = (layout.rows, layout.dim) if layout.dim else (layout.rows,)
        n = len(layout.bonds.group)
        self.objectives = objectives
        self.whole_w = np.zeros((objectives, *shape))
        self.w = self.whole_w if layout.dim else self.whole_w[:, : layout.sites]
        self.whole_p = np.zeros((objectives, layout.most, layout.room))
        self.p, self.g = self.whole_p[..., :n], np.zeros((objectives, n))


class Seeds:
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
        self.rows = np.ascontiguousarray(rows, dtype=float)
        self.places = np.ascontiguousarray(places, dtype=np.int64)
        self.of_u, self.begin, self.end = of_u, begin, begin + rows.shape[1] - 1
        addresses = self.rows.ctypes.data, self.places.ctypes.data
        self._structure = _SEEDS(*addresses, len(self.places), of_u, begin, self.end)
        self.address = ctypes.addressof(self._structure)


def sampled(bound, steps, u, v, places, of_u, rows, lib):
    """Do steps with a bound loop one by one, keeping entries of u and v after each in `rows`."""
    if hasattr(bound, "sample"):
        bound.sample(steps, places, of_u, rows)
        return
    function, arguments = getattr(bound, "_call", (None, ()))  # of C, and what it is called with
    if len(arguments) != 1 or lib is None:
        for row in rows:
            bound.advance(1)
            row[:of_u], row[of_u:] = u.ravel()[places[:of_u]], v.ravel()[places[of_u:]]
        return
    step, arrays = (_pointer(function), *arguments), (x.ctypes.data for x in (u, v, places))
    lib.sampled(*step, steps, *arrays, len(places), of_u, rows.ctypes.data)


def _pointer(function):
    return ctypes.cast(function, ctypes.c_void_p).value
