"""The loop backwards: what a run did undone, stage by stage, with derivatives carried along.

A stage of a splitting can be undone from its result, so the derivatives of what was computed need
no states kept: the adjoint of each stage is done where the stage is undone.  A method's rows are
those of `methods.Splitting`; what runs is the C of `reverse_*.c`.
"""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine import march
from tensegrity.engine.bonds import WALL, by_spring
from tensegrity.engine.bound import integers, stages
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
        b, dim, n, room = layout.bonds, layout.dim, len(layout.bonds.group), layout.room
        self.u, self.v = np.zeros((2, *layout.shape))
        self.ub, self.vb = np.zeros((2, totals.objectives, *layout.shape))
        w, load = np.zeros((2, *layout.shape))
        w[: layout.sites] = b.inverse_mass[:, None] if dim else b.inverse_mass
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
        state = {"u": self.u, "v": self.v, "w": w, "ub": self.ub, "vb": self.vb}
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
        self.address = ctypes.addressof(self._structure)

    def retune(self, bonds):
        """Begin anew with the masses and parameters of other bonds, in the same runs of a line.

        Derivatives and totals are 0 then.
        """
        self._structure.filled["w"][: self.layout.sites] = bonds.inverse_mass
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

    def reverse(self, steps, last, seeds=None, opened=True):
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
        given = None if seeds is None else seeds.address
        self.layout.library.reverse(self.address, steps, opened, last, given)

    def sow(self, seeds, k):
        """Add what objectives have to do with the state after step number k."""
        self.layout.library.sow(self.address, seeds.address, k)

    # forwards, on a grid

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:], self._travel[:] = np.inf, -np.inf, 0

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`."""
        b = self.layout.bonds
        return by_spring(b.group[self.layout.order], len(b.law), self._low, self._high)

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]."""
        return float(self._travel[0])


class OnGrid:
    """A scene whose moves are rounded to whole units of a grid, so that steps can be undone to the
    last bit; as `bound.Bound`, without rows behind the sites.

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
        self._back = back = Back(layout, method, dt, Totals(layout, 0), grid)
        self.u, self.v, self._sites = u, v, layout.sites
        self.shown, self._shown = (
            (u.copy(), v.copy()),
            (np.zeros_like(back.u), np.zeros_like(back.v)),
        )
        self.forget_range = back.forget_range
        functions = layout.library.advance, layout.library.show
        advance, show = map(march.pointer, functions)
        self._loop = march.LOOP(
            advance=advance,
            show=show,
            scene=back.address,
            method=None,
            u=back.u,
            v=back.v,
            shown_u=self._shown[0],
            shown_v=self._shown[1],
            sums=None,
            travel=back._travel,
            size=back.u.size,
            sum_count=0,
        )

    def go(self, done, end, wanted=()):
        """As `Bound.go`."""
        back, sites = self._back, self._sites
        back.set(self.u[:sites], self.v[:sites])
        stopped = march.go(self._loop, done, end, wanted, sites * max(back.layout.dim, 1), 0)
        self.u[:sites], self.v[:sites] = back.state()
        for array, shown in zip(self.shown, self._shown, strict=True):
            array[:sites] = shown[:sites]
        return stopped

    def advance_open(self, steps, opened):
        """As `Bound.advance_open`."""
        self.go(int(opened), int(opened) + steps)

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`."""
        return self._back.range

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]."""
        return self._back.travel


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
