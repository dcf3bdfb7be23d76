"""Arrays bound to a compiled loop: what lines and networks have in common."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.engine.structs import structure
from tensegrity.engine.walk import Part

NYSTROM = structure("steps.c", "nystrom")
OPENINGS = structure("openings.h", "openings")


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
    taken : list of (Structure, str)
        Fields with what depends on the step, and is proportional to it.
    kept : list of (Structure, str)
        Likewise where elongations are kept, all in a row, and behind them the way travelled.
    """

    _show = _openings = None

    def _set_steps(self, loop, structure, bonds, method, dt, moving, places=None):
        """Prepare the call of a method's steps."""
        self._structure, address = structure, ctypes.addressof(structure)
        self.taken = [(structure, "kicks"), (structure, "drifts")]
        if isinstance(method, Splitting):
            self._call = loop.advance, (address,)
            self._part = loop.advance_part, address
            return
        if isinstance(method, Corrected):
            self._set_openings(loop, bonds, method, dt, places)
            return
        count, dt = structure.filled["u"].size, np.array([dt], dtype=loop.dtype)
        self._steps = NYSTROM(
            nodes=np.multiply(method.nodes, dt),
            velocities=np.multiply(method.velocities, dt),
            matrix=np.multiply(method.matrix, dt**2),
            positions=np.multiply(method.positions, dt**2),
            dt=dt,
            place=np.zeros(count, dtype=loop.dtype),
            slopes=np.zeros((method.stages, count), dtype=loop.dtype),
            travel=self._travel,
            stages=method.stages,
            count=count,
            moving=moving,
        )
        self._call = loop.advance_nystrom, (address, ctypes.addressof(self._steps))

    def _set_openings(self, loop, bonds, method, dt, places):
        """Prepare the steps of a corrected method; `places` are those of the loop's contacts."""
        found, u = Openings(bonds, method, dt), self._structure.filled["u"]
        of_bonds = {name: getattr(found, name) for name in ("place", "side", "strength", "row")}
        if places is not None:
            real = places >= 0
            none = dict.fromkeys(of_bonds, np.nan) | {"row": 0}
            of_bonds = {k: np.where(real, x[:, places], none[k]) for k, x in of_bonds.items()}
        elif u.ndim > 1:
            shape = len(found.row), len(u) - 1, self._lanes
            of_bonds = {
                name: np.broadcast_to(x.reshape(*shape[:2], -1), shape)
                for name, x in of_bonds.items()
            }
        row = integers(of_bonds.pop("row"))
        numbers = {name: getattr(found, name) for name in ("exponents", "betas", "tables")}
        numbers |= dict(zip(("nodes", "weights", "offsets"), method.rule, strict=True))
        numbers |= of_bonds | {"dt": [dt]}
        overlaps = "before", "rate_before", "after", "rate_after"
        states = "u", "v", "end_u", "end_v", "end_a"
        self._openings = steps = OPENINGS(
            **{name: loop.numbers(x) for name, x in numbers.items()},
            **{name: np.zeros(row.size, dtype=loop.dtype) for name in overlaps},
            **{name: np.zeros(u.size, dtype=loop.dtype) for name in states},
            row=row,
            count=row.size,
            bonds=row.size // len(row),
            entries=u.size,
            kicks=len(found.nodes),
            degree=DEGREE,
            known=0,
            begins=0,
            alone=0,
        )
        self.taken.append((steps, "dt"))
        advance, show = loop.openings
        self._call = advance, (ctypes.addressof(self._structure), ctypes.addressof(steps))
        self._show = show, ctypes.addressof(steps)

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
        arrays = self._structure.filled
        return [Part(..., *self._call, arrays["u"], arrays["v"], begins)]

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
        self._of = of
        self._structure = type(structure)(**structure.filled | {"u": u, "v": v})
        self.kept = [(self._structure, name) for _, name in kept]
        function, openings = call
        self._call = function, (ctypes.addressof(self._structure), openings)

    def forget_range(self):
        """There is none: no step is done."""

    @property
    def range(self):
        """No elongation met."""
        return np.tile([np.inf, -np.inf], (len(self._of.range), 1))

    advance, parts = Bound.advance, Bound.parts


def stages(method, dt, dtype=np.float64):
    """Fields of a scene: kicks and drifts times dt, how many, and whether a kick closes a step."""
    if isinstance(method, Corrected):
        method = method.base
    splitting = isinstance(method, Splitting)
    rows = (method.kicks, method.drifts) if splitting else ([0.0], [0.0])
    kicks, drifts = (np.multiply(x, dt, dtype=dtype) for x in rows)
    count = method.stages if splitting else 0
    return {"kicks": kicks, "drifts": drifts, "stages": count, "closing": int(kicks[-1] != 0)}


def integers(array):
    return np.ascontiguousarray(array, dtype=np.int64)
