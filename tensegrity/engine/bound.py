"""Arrays bound to a compiled loop: what lines and networks have in common."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine.compiled import structure_of
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.engine.walk import Part

NYSTROM = structure_of(  # as in steps.c
    "_Nystrom",
    "nodes velocities matrix positions dt place slopes travel",
    "stages count moving",
)
OPENINGS = structure_of(  # as in openings.h
    "_Openings",
    "place side strength exponents betas tables nodes weights offsets dt "
    "before rate_before after rate_after u v end_u end_v end_a row",
    "count bonds entries kicks degree known begins alone",
)


class Bound:
    """Arrays bound to a loop: `advance` costs no more than a call.

    Attributes
    ----------
    springs : int
        Different ones.
    range : ndarray, (springs, 2)
        Smallest and largest elongation of each since `forget_range`.
    travel : float
        Bound on how far any coordinate of a site moved since then [m]; networks only.
    taken : list of (Structure, str, ndarray)
        What depends on the step, and is proportional to it: field of a structure, and its array.
    kept : list of (Structure, str, ndarray)
        Likewise where elongations are kept, all in a row, and behind them the way travelled.
    """

    _show = _openings = None

    def _set_steps(self, loop, structure, arrays, bonds, method, dt, moving, places=None):
        """Keep what the structure points to, and prepare the call of a method's steps."""
        self._structure, self._arrays = structure, arrays
        address = ctypes.addressof(structure)
        steps = ("kicks", self._kicks), ("drifts", self._drifts)
        self.taken = [(structure, name, array) for name, array in steps]
        if isinstance(method, Splitting):
            self._call = loop.advance, (address,)
            self._part = loop.advance_part, address
            return
        if isinstance(method, Corrected):
            self._set_openings(loop, bonds, method, dt, places)
            return
        u, dt = arrays[0], np.array([dt], dtype=loop.dtype)
        rows = [
            np.multiply(method.nodes, dt),
            np.multiply(method.velocities, dt),
            np.multiply(method.matrix, dt**2),
            np.multiply(method.positions, dt**2),
            dt,
            np.zeros(u.size, dtype=loop.dtype),
            np.zeros((method.stages, u.size), dtype=loop.dtype),
            self._travel,
        ]
        steps = NYSTROM(*(x.ctypes.data for x in rows), method.stages, u.size, moving)
        self._arrays += [rows, steps]
        self._call = loop.advance_nystrom, (address, ctypes.addressof(steps))

    def _set_openings(self, loop, bonds, method, dt, places):
        """Prepare the steps of a corrected method; `places` are those of the loop's contacts."""
        found, u = Openings(bonds), self._arrays[0]
        of_bonds = [found.place, found.side, found.strength, found.row]
        if places is not None:
            real = places >= 0
            *numbers, row = (np.where(real, x[:, places], np.nan) for x in of_bonds)
            of_bonds = [*numbers, np.where(real, row, 0)]
        elif u.ndim > 1:
            shape = len(found.row), len(u) - 1, self._lanes
            of_bonds = [np.broadcast_to(x.reshape(*shape[:2], -1), shape) for x in of_bonds]
        *numbers, row = of_bonds
        count, corners = row.size, len(row)
        rows = [
            *(loop.numbers(x) for x in numbers),
            *(loop.numbers(x) for x in (found.exponents, found.betas, found.tables)),
            *(loop.numbers(x) for x in method.rule),
            np.array([dt], dtype=loop.dtype),
            *np.zeros((4, count), dtype=loop.dtype),
            *np.zeros((5, u.size), dtype=loop.dtype),
            np.ascontiguousarray(row, dtype=np.int64),
        ]
        address = [x.ctypes.data for x in rows]
        per_corner = count // corners
        steps = OPENINGS(*address, count, per_corner, u.size, len(method.rule[0]), DEGREE, 0, 0, 0)
        self._arrays += [rows, steps]
        (step,) = (x for x, (name, _) in zip(rows, OPENINGS._fields_, strict=False) if name == "dt")
        self.taken.append((steps, "dt", step))
        advance, show = loop.openings
        self._call = advance, (ctypes.addressof(self._structure), ctypes.addressof(steps))
        self._show, self._openings = (show, ctypes.addressof(steps)), steps

    def show(self, u, v):
        """What makes copies of u and v what is looked at; None where they are that already."""
        known = self._show
        return None if known is None else _Shown(known, self._structure, self.kept, u, v, self)

    def advance(self, steps):
        """Advance u and v by whole steps."""
        function, addresses = self._call
        function(*addresses, steps)

    @property
    def address(self):
        """Where the structure is that the loop takes."""
        return ctypes.addressof(self._structure)

    def parts(self):
        """What `walk` needs to advance them with others."""
        begins = self._openings and ctypes.addressof(self._openings) + OPENINGS.begins.offset
        return [Part(..., *self._call, *self._arrays[:2], begins)]

    def begin(self):
        """Say that the next step is the first of a run."""
        if self._openings is not None:
            self._openings.begins = 1

    def stand_alone(self):
        """Say that steps have none before them and none behind."""
        if self._openings is not None:
            self._openings.alone = 1

    def advance_part(self, steps, opened, close):
        """Steps of a splitting whose first kick includes the last one of the steps before, if
        `opened`, and whose own last kick is left out, unless `close`."""
        function, address = self._part
        function(address, steps, opened, close)

    @property
    def travel(self):
        return float(self._travel[0])

    @property
    def travel_at(self):
        """Address of that number."""
        return self._travel.ctypes.data


class _Shown:
    """What is looked at after steps of a corrected method, from copies of u and v; as `Bound`."""

    taken, travel, _openings = (), 0.0, None

    def __init__(self, call, structure, kept, u, v, of):
        self._arrays, self._of = (u, v), of  # whose other arrays these are
        self._structure = type(structure).from_buffer_copy(structure)
        self._structure.u, self._structure.v = u.ctypes.data, v.ctypes.data
        self.kept = [(self._structure, name, array) for _, name, array in kept]
        function, openings = call
        self._call = function, (ctypes.addressof(self._structure), openings)

    def forget_range(self):
        """There is none: no step is done."""

    @property
    def range(self):
        """No elongation met."""
        return np.tile([np.inf, -np.inf], (len(self._of.range), 1))

    advance, parts = Bound.advance, Bound.parts


def kicks_and_drifts(method, dt, dtype):
    """Kicks and drifts times dt, number of stages, and whether a kick closes the step."""
    if isinstance(method, Corrected):
        method = method.base
    if not isinstance(method, Splitting):
        return np.zeros(1, dtype), np.zeros(1, dtype), 0, 0
    kicks = np.multiply(method.kicks, dt, dtype=dtype)
    return kicks, np.multiply(method.drifts, dt, dtype=dtype), method.stages, int(kicks[-1] != 0)


def integers(array):
    return np.ascontiguousarray(array, dtype=np.int64)
