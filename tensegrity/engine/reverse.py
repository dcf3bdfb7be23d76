"""The loop backwards: what a run did undone, stage by stage, with derivatives carried along.

A stage of a splitting can be undone from its result, so the derivatives of what was computed need
no states kept: the adjoint of each stage is done where the stage is undone.  A method's rows are
those of `methods.Splitting`; what runs is the C of `reverse_*.c`.
"""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine.bonds import WALL, by_spring
from tensegrity.engine.reverse_layout import PACK


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
        kicks, drifts = (np.multiply(x, dt) for x in (method.kicks, method.drifts))
        b, dim, n, room = layout.bonds, layout.dim, len(layout.bonds.group), layout.room
        self.u, self.v = np.zeros((2, *layout.shape))
        self.ub, self.vb = np.zeros((2, totals.objectives, *layout.shape))
        w, load = np.zeros((2, *layout.shape))
        w[: layout.sites] = b.inverse_mass[:, None] if dim else b.inverse_mass
        place = np.zeros((dim + 2, n))
        if dim:
            load[: layout.sites] = b.contacts.load
            place = np.ascontiguousarray(b.contacts.geometry[:, layout.order])
        shared, own, own_at = layout.parameters(b)
        at, to = (max(dim, 1) * x[layout.order] for x in layout.ends)
        entries = self.u.size
        filled = entries if dim else entries - PACK
        self._low, self._high, self._travel = np.empty(n), np.empty(n), np.zeros(1)
        self.forget_range()
        numbers = [
            self.u, self.v, w, load, shared, own, place, kicks, drifts,
            np.array(grid), self.ub, self.vb, totals.whole_w,
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
        given = None if seeds is None else seeds.address
        self.layout.library.reverse(self._address, steps, opened, close, last, given)

    def sow(self, seeds, k):
        """Add what objectives have to do with the state after step number k."""
        self.layout.library.sow(self._address, seeds.address, k)

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
        addresses = self.rows.ctypes.data, self.places.ctypes.data
        self._structure = _SEEDS(*addresses, len(self.places), of_u, begin, self.end)
        self.address = ctypes.addressof(self._structure)


def sampled(bound, steps, u, v, places, of_u, rows, lib):
    """Do steps with a bound loop one by one, keeping entries of u and v after each in `rows`."""
    if hasattr(bound, "sample"):
        bound.sample(steps, places, of_u, rows)
        return
    function, arguments = getattr(bound, "_call", (None, ()))  # of C, and what it is called with
    if len(arguments) != 1:
        for row in rows:
            bound.advance(1)
            row[:of_u], row[of_u:] = u.ravel()[places[:of_u]], v.ravel()[places[of_u:]]
        return
    _sample(lib, function, *arguments, steps, (u, v, places), of_u, rows)


def _sample(lib, function, loop, steps, arrays, of_u, rows):
    step = ctypes.cast(function, ctypes.c_void_p).value, loop
    addresses = (x.ctypes.data for x in arrays)
    lib.sampled(*step, steps, *addresses, len(arrays[2]), of_u, rows.ctypes.data)
