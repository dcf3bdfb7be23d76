"""A scene's arrays bound to a compiled loop: of a chain, chains side by side or a network, for all
methods.

C takes structures that it declares itself: the loop's `scene`, which is bonds, masses and a
splitting's coefficients, and for other methods one more.
"""

from __future__ import annotations

import ctypes
from itertools import pairwise

import numpy as np

from tensegrity.engine import implicit, layout, march, openings
from tensegrity.engine.bonds import by_spring, integers, parameters
from tensegrity.engine.methods import Corrected, Midpoint, Splitting
from tensegrity.engine.native import pointer, structure
from tensegrity.errors import StabilityError

SCENE = structure("scene.h", "scene")
NYSTROM = structure("steps.c", "nystrom")
IMPLICIT = structure("implicit.c", "implicit")
OPENINGS = structure("overlaps.c", "openings")
CACHE = 8  # numbers in a line of a cache
ROW = 1, 1, 2, 4  # numbers in a site's row of forces, by coordinates: as in simd.c


class Bound:
    """Arrays bound to a loop: `advance` costs no more than a call.

    Parameters
    ----------
    loop : Compiled
    u, v : ndarray
        What is advanced in place: (sites,) or (sites, lanes) of chains; of a network (rows, dim),
        rows being sites, walls, and a spare one.
    bonds : Bonds
    method : Method
    dt : float
        [s]
    pieces : int, optional
        Parts of a network of about equal work, each to be advanced by a thread of its own.
    runs : Runs, optional
        Of a chain, a part of those of `bonds`.
    seen : ndarray of bool, (runs,), optional
        Those whose elongations count; by default all.

    Attributes
    ----------
    u, v : ndarray
        Between steps v lacks the closing kick of the last.
    shown : tuple of ndarray
        Copies of u and v at the end of `go`, as the state there.
    sizes : (int, int)
        Numbers of u that sites have, and walls behind them.
    """

    _dt = _alone = output_sums = None

    def __init__(self, loop, u, v, bonds, method, dt, pieces=1, runs=None, seen=None):
        self._loop, self._bonds, self.u, self.v = loop, bonds, u, v
        self._layout = found = layout.loop_layout(loop, bonds, pieces, runs)
        self.sizes, self._travel = (u.size, 0), np.zeros(1, dtype=loop.dtype)
        self._set_ranges(found.springs, found.fields["range_at"], seen)
        fields = found.fields | stages(method, 1.0, loop.dtype)
        fields |= {"u": u, "v": v, "low": self._low, "high": self._high}
        if loop.dim:
            sites = fields["sites"]
            self.sizes = loop.dim * sites, loop.dim * (fields["rows"] - 1 - sites)
            fields |= self._room(pieces) | {"travel": self._travel}
            cuts = enumerate(pairwise(found.slices.balanced_cuts(pieces)))
            self._pieces = [SCENE(**fields, **_piece(found, *ends, k, pieces)) for k, ends in cuts]
            fields |= _piece(found, 0, found.slices.tiles, 0, 1)
        else:  # what only networks have is left out
            fields = dict.fromkeys(SCENE.kinds) | fields
        self._bind(SCENE(**fields), method)
        self.set_step(dt)
        self.forget_range()

    def _set_ranges(self, springs, range_at, seen=None):
        """Room for the smallest and the largest elongation met, where the loop notes them."""
        self._counted = slice(None) if seen is None else np.repeat(seen, np.diff(range_at))
        self._springs = springs[self._counted]
        self._one_to_one = np.array_equal(self._springs, np.arange(len(self._bonds.law)))
        self._low, self._high = np.empty((2, len(springs)), dtype=self._loop.dtype)

    def _room(self, pieces):
        """What a network's loop works in."""
        fields, dtype, load = self._layout.fields, self._loop.dtype, self._bonds.contacts.load
        size = pieces * len(load) * ROW[self._loop.dim]
        room = np.zeros(size + CACHE, dtype=dtype)
        pull = room[-room.ctypes.data // room.itemsize % CACHE :][:size]  # no row in two lines
        pull.reshape(pieces, len(load), -1)[..., : self._loop.dim] = load
        return {
            "near": np.zeros((2, self.u.size) if pieces > 1 else 0, dtype=dtype),
            "pull": pull,
            "press": np.zeros_like(fields["normal"]),
            "force": np.zeros(self.u[len(load) :].shape, dtype=dtype),
            "farthest": np.zeros(pieces, dtype=dtype),
            "gate": np.zeros(16, dtype=np.int64),
        }

    # methods

    def _bind(self, scene, method):
        """Prepare a method's steps, with what they take besides the scene."""
        self._scene, self._scaled_fields = scene, []
        self._scale_with_step(scene, "kicks", "drifts")
        kind, self._second = self._steps(method)
        self._advance, self._postprocess = self._loop.steps(kind)
        self._addresses = [x and ctypes.addressof(x) for x in (scene, self._second)]
        self.output = np.empty_like(self.u), np.empty_like(self.v)
        self._march = self._marched(self._advance)

    def _marched(self, advance):
        """What `march.c` takes of a loop that a function advances."""
        return march.LOOP(
            advance=pointer(advance),
            postprocess=self._postprocess and pointer(self._postprocess),
            scene=self._scene,
            method=self._second,
            u=self.u,
            v=self.v,
            output_u=self.output[0],
            output_v=self.output[1],
            sums=self.output_sums,
            travel=self._travel,
            size=self.u.size,
            sum_count=2,
        )

    def _steps(self, method):
        """The kind of a method's steps, and its structure."""
        if isinstance(method, Splitting):
            return "", None
        if isinstance(method, Corrected):
            return "openings", self._corrections(method)
        if isinstance(method, Midpoint):
            self._words = f"is too large for {method.name}: its equations were not solved in "
            return "implicit", self._equations()
        return "nystrom", self._accelerations(method)

    def _scale_with_step(self, structure, *names, power=1):
        """Let numbers of a structure, of a step of 1 s, go with the power of a step."""
        for name in names:
            array = structure.filled[name]
            self._scaled_fields.append((array, array.copy(), power))

    def set_step(self, dt):
        """Go on with steps of another length [s]."""
        if dt == self._dt:
            return
        self._dt = None  # until all are changed, whatever interrupts
        for array, of_one, power in self._scaled_fields:
            np.multiply(of_one, array.dtype.type(dt) ** power, out=array)
        self._dt = dt

    def _accelerations(self, method):
        """Of a method that sums accelerations."""
        loop, rows = self._loop, ("nodes", "velocities", "matrix", "positions")
        steps = NYSTROM(
            **{name: np.array(getattr(method, name), dtype=loop.dtype) for name in rows},
            dt=np.ones(1, dtype=loop.dtype),
            place=np.zeros(self.u.size, dtype=loop.dtype),
            slopes=np.zeros((method.stages, self.u.size), dtype=loop.dtype),
            travel=self._travel,
            stages=method.stages,
            count=self.u.size,
            moving=self.sizes[0],
        )
        self._scale_with_step(steps, "nodes", "velocities", "dt")
        self._scale_with_step(steps, "matrix", "positions", power=2)
        return steps

    def _equations(self):
        """Of the implicit midpoint rule."""
        fields = implicit.fields(self._loop, self.u, self._bonds)
        steps = IMPLICIT(**fields, travel=self._travel)
        self._scale_with_step(steps, "dt")
        return steps

    def _corrections(self, method):
        """Of a method that corrects where contacts open."""
        loop, u = self._loop, self.u
        numbers = openings.contacts(self._bonds, loop.lanes)
        numbers |= dict(zip(("nodes", "weights", "offsets"), method.rule, strict=True))
        row = integers(numbers.pop("row"))
        numbers["dt"] = [1.0]
        sizes = dict.fromkeys(("before", "rate_before", "after", "rate_after"), row.size)
        sizes |= dict.fromkeys(("u", "v", "end_u", "end_v", "end_a"), u.size)
        self._alone = steps = OPENINGS(
            **{name: loop.numbers(x) for name, x in numbers.items()},
            **{name: np.zeros(size, dtype=loop.dtype) for name, size in sizes.items()},
            row=row,
            count=row.size,
            bonds=row.size // len(row),
            entries=u.size,
            kicks=len(method.rule[0]),
            degree=openings.DEGREE,
            known=0,
            begins=0,
            alone=0,
        )
        self._scale_with_step(steps, "dt")
        return steps

    def stand_alone(self):
        """Say that steps have none before them and none behind."""
        if self._alone is not None:
            self._alone.alone = 1

    # motion

    def go(self, done, end, wanted=()):
        """Advance from step `done` of a run to `end`, which is shown, and take what is `Wanted`.

        Returns what `march.go` does.
        """
        return march.go(self._march, done, end, wanted, *self.sizes)

    def advance(self, steps, opened=False):
        """Advance u and v by whole steps, in place; `opened` says whether others came before, where
        that matters to a method."""
        corrects = self._alone is not None
        self.advance_open(steps, opened and corrects)
        if self._postprocess is not None and not corrects:
            self._postprocess(*self._addresses, self.u.ctypes.data, self.v.ctypes.data)

    def advance_open(self, steps, opened):
        """Steps without the closing kick of the last, which begin with that of the step before if
        `opened`."""
        if self._advance(*self._addresses, steps, opened):
            raise self.why_stopped()

    def why_stopped(self):
        """Why steps could not be done."""
        return StabilityError(
            f"dt {self._dt:.6g} s {self._words}{implicit.ITERATIONS} iterations; the springs "
            "change too much within a step"
        )

    def retune(self, bonds):
        """Go on with the masses and parameters of other bonds, of the same laws and in the same
        runs of a chain.  What it was made of changes with it."""
        fields = parameters(bonds, self._layout.runs, self._loop.own, self._loop.lanes)
        for name, values in (fields | {"w": bonds.inverse_mass}).items():
            self._scene.filled[name][:] = values

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:], self._travel[:] = np.inf, -np.inf, 0

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`, (springs,
        2)."""
        low, high = self._low[self._counted], self._high[self._counted]
        if self._one_to_one:
            return np.stack((low, high), axis=1)
        return by_spring(self._springs, len(self._bonds.law), low, high)

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]; of networks."""
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


def _piece(laid, tile, last, number, pieces):
    """What a thread does of a network: the tiles to the last one."""
    return {
        "tile": tile,
        "last_tile": last,
        "before": laid.slices.needed[tile],
        "reach": laid.slices.reach[last],
        "piece": number,
        "pieces": pieces,
    }
