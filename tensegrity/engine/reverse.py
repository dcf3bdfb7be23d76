"""The loop backwards: what a run did undone, stage by stage, with derivatives carried along.

A stage of a splitting can be undone from its result, so the derivatives of what was computed need
no states kept: the adjoint of each stage is done where the stage is undone.  A method's rows are
those of `methods.Splitting`; what runs is the C of `reverse_*.c`, or without a compiler the same
in NumPy.
"""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from tensegrity.engine.bonds import WALL, by_spring
from tensegrity.engine.bound import integers, stages
from tensegrity.engine.pulled import Pulled
from tensegrity.engine.reverse_layout import PACK
from tensegrity.engine.structs import structure

SCENE = structure("reverse.h", "scene")
SEEDS = structure("reverse.h", "seeds")


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
        self.layout, self._totals = layout, totals
        steps = stages(method, dt)
        self._kicks, self._drifts = steps["kicks"], steps["drifts"]
        b, dim, n, room = layout.bonds, layout.dim, len(layout.bonds.group), layout.room
        self.u, self.v = np.zeros((2, *layout.shape))
        self.ub, self.vb = np.zeros((2, totals.objectives, *layout.shape))
        self._w, w = np.zeros(layout.shape), b.inverse_mass
        self._w[: layout.sites] = w[:, None] if dim else w
        if layout.library is None:
            return
        load = np.zeros(layout.shape)
        place = np.zeros((dim + 2, n))
        if dim:
            load[: layout.sites] = b.contacts.load
            place = np.ascontiguousarray(b.contacts.geometry[:, layout.order])
        first, second = (max(dim, 1) * x[layout.order] for x in layout.ends)
        entries = self.u.size
        self._low, self._high, self._travel = np.empty(n), np.empty(n), np.zeros(1)
        self.forget_range()
        law, wall = 2 * layout.run_law + layout.run_own, layout.kind[layout.order] == WALL
        where = {"from": first, "to": second, "first": layout.first, "law": law}
        where["wall"] = wall[layout.first[:-1]]
        scratch = {"r": room, "f": room + 2, "k": room, "bent": room, "d": (layout.most, room)}
        scratch |= {"along": (dim, n), "pull": entries, "turn": entries}
        state = {"u": self.u, "v": self.v, "w": self._w, "ub": self.ub, "vb": self.vb}
        met = {"low": self._low, "high": self._high, "travel": self._travel}
        counts = {"runs": len(layout.run_law), "bonds": n, "entries": entries, "apart": room}
        self._structure = SCENE(
            **steps,
            **layout.parameters(b),
            **{name: integers(x) for name, x in where.items()},
            **{name: np.zeros(size) for name, size in scratch.items()},
            **state,
            **met,
            **counts,
            load=load,
            geometry=place,
            grid=np.array(grid),
            wb=totals.whole_w,
            pb=totals.whole_p,
            gb=totals.g,
            moving=layout.sites * max(dim, 1),
            objectives=totals.objectives,
            wanted=layout.most,
            room=entries if dim else entries - PACK,
        )
        self._address = ctypes.addressof(self._structure)

    def retune(self, bonds):
        """Begin anew with the masses and parameters of other bonds, in the same runs of a line.

        Derivatives and totals are 0 then.
        """
        self._w[: self.layout.sites] = bonds.inverse_mass
        for name, values in self.layout.parameters(bonds).items():
            self._structure.filled[name][:] = values
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
        kicks, drifts = self._kicks, self._drifts
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
            for array, mine in ((self.ub, slice(of_u)), (self.vb, slice(of_u, None))):
                array.reshape(len(row), -1)[:, seeds.places[mine]] += row[:, mine]

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
        lib = self.layout.library
        _sample(lib, lib.advance, self._address, steps, (self.u, self.v, places), of_u, rows)


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
        n = len(layout.bonds.group)
        self.objectives = objectives
        self.whole_w = np.zeros((objectives, *layout.shape))
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
        arrays, count = {"rows": self.rows, "places": self.places}, len(self.places)
        self._structure = SEEDS(**arrays, count=count, of_u=of_u, begin=begin, end=self.end)
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
    _sample(lib, function, *arguments, steps, (u, v, places), of_u, rows)


def _sample(lib, function, loop, steps, arrays, of_u, rows):
    step = ctypes.cast(function, ctypes.c_void_p).value, loop
    addresses = (x.ctypes.data for x in arrays)
    lib.sampled(*step, steps, *addresses, len(arrays[2]), of_u, rows.ctypes.data)
