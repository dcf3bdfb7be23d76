"""Arrays bound to a compiled loop: what lines and networks have in common."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine import implicit, march
from tensegrity.engine.methods import Corrected, Midpoint, Splitting
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.engine.structs import structure
from tensegrity.errors import StabilityError

NYSTROM = structure("steps.c", "nystrom")
IMPLICIT = structure("implicit.c", "implicit")
OPENINGS = structure("openings.h", "openings")


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

    def _set_steps(self, loop, scene, bonds, method, dt, moving, walls=0, places=None):
        """Prepare the functions of a method's steps."""
        self._scene, self.sizes = scene, (moving, walls)
        self.u, self.v = scene.filled["u"], scene.filled["v"]
        self.shown = np.empty_like(self.u), np.empty_like(self.v)
        self._of_step, functions, second = [], (loop.advance, loop.show), None
        self._scale_with_step(scene, "kicks", "drifts")
        if isinstance(method, Corrected):
            functions = loop.openings
            second = self._openings = self._set_openings(loop, bonds, method, places)
        elif isinstance(method, Midpoint):
            functions, second = (loop.implicit, None), self._set_implicit(loop, bonds, method)
        elif not isinstance(method, Splitting):
            functions = loop.advance_nystrom, None
            second = self._set_nystrom(loop, method, moving)
        self.functions, self._second = functions, second
        self.addresses = ctypes.addressof(scene), second and ctypes.addressof(second)
        self._march = self.loop_of(functions, second)
        self.set_step(dt)

    def loop_of(self, functions, method, sums=None):
        """What `march.c` takes: functions that advance and show, and what they take."""
        advance, show = (one and march.pointer(one) for one in functions)
        return march.LOOP(
            advance=advance, show=show, scene=self._scene, method=method, u=self.u, v=self.v,
            shown_u=self.shown[0], shown_v=self.shown[1], sums=sums, travel=self._travel,
            size=self.u.size, sum_count=2,
        )  # fmt: skip

    def _scale_with_step(self, structure, *names, power=1):
        """Let numbers of a structure, of a step of 1 s, go with the power of a step."""
        for name in names:
            array = structure.filled[name]
            self._of_step.append((array, array.copy(), power))

    def set_step(self, dt):
        """Go on with steps of another length [s]."""
        if dt == self._dt:
            return
        self._dt = None  # until all are changed, whatever interrupts
        for array, of_one, power in self._of_step:
            np.multiply(of_one, array.dtype.type(dt) ** power, out=array)
        self._dt = dt

    def _set_implicit(self, loop, bonds, method):
        """Prepare the steps of the midpoint rule."""
        steps = IMPLICIT(**implicit.fields(loop, self.u, bonds), travel=self._travel)
        self._scale_with_step(steps, "dt")
        self._words = f"is too large for {method.name}: its equations were not solved in "
        return steps

    def why_stopped(self):
        """Why steps could not be done."""
        return StabilityError(
            f"dt {self._dt:.6g} s {self._words}{implicit.ITERATIONS} iterations; the springs "
            "change too much within a step"
        )

    def _set_nystrom(self, loop, method, moving):
        """Prepare the steps of a method that sums accelerations."""
        rows = "nodes", "velocities", "matrix", "positions"
        steps = NYSTROM(
            **{name: np.array(getattr(method, name), dtype=loop.dtype) for name in rows},
            dt=np.ones(1, dtype=loop.dtype),
            place=np.zeros(self.u.size, dtype=loop.dtype),
            slopes=np.zeros((method.stages, self.u.size), dtype=loop.dtype),
            travel=self._travel,
            stages=method.stages,
            count=self.u.size,
            moving=moving,
        )
        self._scale_with_step(steps, "nodes", "velocities", "dt")
        self._scale_with_step(steps, "matrix", "positions", power=2)
        return steps

    def _set_openings(self, loop, bonds, method, places):
        """Prepare the steps of a corrected method; `places` are those of the loop's contacts."""
        found, u = Openings(bonds), self.u
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
        numbers |= of_bonds | {"dt": [1.0]}
        overlaps = "before", "rate_before", "after", "rate_after"
        states = "u", "v", "end_u", "end_v", "end_a"
        steps = OPENINGS(
            **{name: loop.numbers(x) for name, x in numbers.items()},
            **{name: np.zeros(row.size, dtype=loop.dtype) for name in overlaps},
            **{name: np.zeros(u.size, dtype=loop.dtype) for name in states},
            row=row,
            count=row.size,
            bonds=row.size // len(row),
            entries=u.size,
            kicks=len(method.rule[0]),
            degree=DEGREE,
            known=0,
            begins=0,
            alone=0,
        )
        self._scale_with_step(steps, "dt")
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
