"""Arrays bound to a compiled loop: what lines and networks have in common."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine import implicit, march
from tensegrity.engine.compiled import structure_of
from tensegrity.engine.methods import Corrected, Midpoint, Splitting
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.errors import StabilityError

NYSTROM = structure_of(  # as in steps.c
    "_Nystrom",
    "nodes velocities matrix positions dt place slopes travel",
    "stages count moving",
)
IMPLICIT = structure_of(  # as in implicit.c
    "_Implicit",
    "geometry parameters load dt straight moved update root force right place slope band travel "
    "law from to at",
    "bonds entries count width iterations",
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
    u, v : ndarray
        What is advanced; v lacks the closing kick of the last step.
    shown : tuple of ndarray
        Copies of u and v at the end of `go`, as the state there.
    sizes : (int, int)
        Numbers of u that sites have, and walls behind them.
    springs : int
        Different ones.
    range : ndarray, (springs, 2)
        Smallest and largest elongation of each since `forget_range`.
    travel : float
        Bound on how far any coordinate of a site moved since then [m]; networks only.
    """

    _openings = _dt = None

    def _set_steps(self, loop, structure, arrays, bonds, method, dt, moving, walls=0, places=None):
        """Keep what the structure points to, and prepare the functions of a method's steps."""
        self._structure, self._arrays = structure, arrays
        self.u, self.v = arrays[:2]
        self.sizes = moving, walls
        self.shown = np.empty_like(self.u), np.empty_like(self.v)
        self._of_step, functions, second = [], (loop.advance, loop.show), None
        self._scale_with_step(self._kicks)
        self._scale_with_step(self._drifts)
        if isinstance(method, Corrected):
            functions = loop.openings
            second = self._openings = self._set_openings(loop, bonds, method, places)
        elif isinstance(method, Midpoint):
            functions, second = (loop.implicit, None), self._set_implicit(loop, bonds, method)
        elif not isinstance(method, Splitting):
            functions = loop.advance_nystrom, None
            second = self._set_nystrom(loop, method, moving)
        self.functions = functions
        self.addresses = ctypes.addressof(structure), second and ctypes.addressof(second)
        self._march = self.loop_of(functions, self.addresses)
        self.set_step(dt)

    def loop_of(self, functions, addresses, sums=None):
        """What `march.c` takes: functions that advance and show, and what they take."""
        arrays = self.u, self.v, *self.shown
        return march.Loop(
            *(one and march.pointer(one) for one in functions), *addresses,
            *(x.ctypes.data for x in arrays), None if sums is None else sums.ctypes.data,
            self._travel.ctypes.data, self.u.size, 2,
        )  # fmt: skip

    def _scale_with_step(self, array, power=1):
        """Let numbers, of a step of 1 s, go with the power of a step."""
        self._of_step.append((array, array.copy(), power))

    def set_step(self, dt):
        """Go on with steps of another length [s]."""
        if dt == self._dt:
            return
        self._dt = dt
        for array, of_one, power in self._of_step:
            np.multiply(of_one, array.dtype.type(dt) ** power, out=array)

    def _set_implicit(self, loop, bonds, method):
        """Prepare the steps of the midpoint rule."""
        fields = implicit.fields(loop, self.u, bonds) | {"travel": self._travel}
        steps = IMPLICIT(
            **{k: x if isinstance(x, int) else x.ctypes.data for k, x in fields.items()}
        )
        self._scale_with_step(fields["dt"])
        self._arrays += [fields, steps]
        self._words = f"is too large for {method.name}: its equations were not solved in "
        return steps

    def why_stopped(self):
        """Why steps could not be done."""
        (dt, _, _), *_ = self._of_step[2:]
        return StabilityError(
            f"dt {float(dt[0]):.6g} s {self._words}{implicit.ITERATIONS} iterations; the springs "
            "change too much within a step"
        )

    def _set_nystrom(self, loop, method, moving):
        """Prepare the steps of a method that sums accelerations."""
        u = self.u
        rows = [
            *(loop.numbers(x) for x in (method.nodes, method.velocities)),
            *(loop.numbers(x) for x in (method.matrix, method.positions)),
            np.ones(1, dtype=loop.dtype),
            np.zeros(u.size, dtype=loop.dtype),
            np.zeros((method.stages, u.size), dtype=loop.dtype),
            self._travel,
        ]
        for array, power in zip(rows, (1, 1, 2, 2, 1), strict=False):
            self._scale_with_step(array, power)
        steps = NYSTROM(*(x.ctypes.data for x in rows), method.stages, u.size, moving)
        self._arrays += [rows, steps]
        return steps

    def _set_openings(self, loop, bonds, method, places):
        """Prepare the steps of a corrected method; `places` are those of the loop's contacts."""
        found, u = Openings(bonds, method, 1.0), self.u
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
        step = np.ones(1, dtype=loop.dtype)
        rows = [
            *(loop.numbers(x) for x in numbers),
            *(loop.numbers(x) for x in (found.exponents, found.betas, found.tables)),
            *(loop.numbers(x) for x in method.rule),
            step,
            *np.zeros((4, count), dtype=loop.dtype),
            *np.zeros((5, u.size), dtype=loop.dtype),
            np.ascontiguousarray(row, dtype=np.int64),
        ]
        self._scale_with_step(step)
        counts = count, count // corners, u.size, len(found.nodes), DEGREE, 0, 0, 0
        steps = OPENINGS(*(x.ctypes.data for x in rows), *counts)
        self._arrays += [rows, steps]
        return steps

    def go(self, done, end, wanted=()):
        """Advance from step `done` of a run to `end`, which is shown, and take what is `Wanted`.

        Returns what `march.go` does.
        """
        return march.go(self._march, done, end, wanted, *self.sizes)

    def advance(self, steps, opened=False):
        """Advance u and v by whole steps, in place; `opened` says whether others came before, where
        that matters to a method."""
        advance, show = self.functions
        corrects = self._openings is not None
        if advance(*self.addresses, steps, opened and corrects):
            raise self.why_stopped()
        if show is not None and not corrects:
            show(*self.addresses, self.u.ctypes.data, self.v.ctypes.data)

    def advance_open(self, steps, opened):
        """Steps without the closing kick of the last, which begin with that of the step before if
        `opened`."""
        self.functions[0](*self.addresses, steps, opened)

    def show(self):
        """Make `shown` the state after the last step of `advance_open`."""
        for copy, array in zip(self.shown, (self.u, self.v), strict=True):
            copy[...] = array
        function = self.functions[1]
        if function is not None:
            function(*self.addresses, *(x.ctypes.data for x in self.shown))

    @property
    def address(self):
        """Where the structure is that the loop takes."""
        return self.addresses[0]

    def stand_alone(self):
        """Say that steps have none before them and none behind."""
        if self._openings is not None:
            self._openings.alone = 1

    @property
    def travel(self):
        return float(self._travel[0])


def rows_of(method, dtype):
    """Kicks and drifts of a step of 1 s, number of stages, and whether a kick closes the step."""
    if isinstance(method, Corrected):
        method = method.base
    if not isinstance(method, Splitting):
        return np.zeros(1, dtype), np.zeros(1, dtype), 0, 0
    kicks, drifts = (np.array(x, dtype=dtype) for x in (method.kicks, method.drifts))
    return kicks, drifts, method.stages, int(kicks[-1] != 0)


def integers(array):
    return np.ascontiguousarray(array, dtype=np.int64)
