"""The arrays of a scene prepared for a compiled loop: of a chain, a batch of chains or a network,
with any method.

The C functions take structures that they declare: the `scene` of the loop, which holds bonds,
masses and the coefficients of a splitting, and one more for other methods.
"""

from __future__ import annotations

import ctypes
from itertools import pairwise

import numpy as np

from tensegrity.engine import implicit, layout, march, openings
from tensegrity.engine.bonds import integers, parameters
from tensegrity.engine.methods import Corrected, Midpoint, Splitting
from tensegrity.engine.native import address, aligned, pointer, structure
from tensegrity.errors import StabilityError, TensegrityError

SCENE = structure("scene.h", "scene")
NYSTROM = structure("nystrom.c", "nystrom")
IMPLICIT = structure("implicit.c", "implicit")
OPENINGS = structure("overlaps.c", "openings")
ROW = 1, 1, 2, 4  # numbers in a site's row of forces, by number of coordinates: as in simd.c


class Bound:
    """Arrays prepared for a loop, so that `advance` is a single call of C.

    Parameters
    ----------
    loop : Compiled
    u, v : ndarray
        Advanced in place: (sites,) or (sites, batch) of chains; (rows, dim) of a network, where
        the rows are sites, walls, and a spare one.
    bonds : Bonds
    method : Method
    dt : float
        Step [s].
    pieces : int, optional
        Number of parts of a network, of about equal work, each for a thread of its own.
    runs : Runs, optional
        Part of the runs of a chain.
    seen : ndarray of bool, (runs,), optional
        Runs whose elongations are noted; by default all.

    Attributes
    ----------
    u, v : ndarray
        Between steps v lacks the closing kick of the last step.
    output : tuple of ndarray
        u and v of the output state at the end of `go`.
    sizes : (int, int)
        Numbers of entries of u that belong to sites, and to the walls after them.
    """

    _dt = _alone = output_sums = None

    def __init__(self, loop, u, v, bonds, method, dt, pieces=1, runs=None, seen=None):
        self._loop, self._bonds, self.u, self.v = loop, bonds, u, v
        self._layout = loop_layout = layout.loop_layout(loop, bonds, pieces, runs)
        self.sizes, self._travel = (u.size, 0), np.zeros(1, dtype=loop.dtype)
        self._active = np.zeros(1 + (loop_layout.slices.tiles if loop.dim else 1), dtype=np.int64)
        self._set_ranges(loop_layout.springs, loop_layout.fields["range_at"], seen)
        fields = loop_layout.fields | stages(method, 1.0, loop.dtype)
        fields |= {"u": u, "v": v, "low": self._low, "high": self._high, "stage": None}
        if loop.dim:
            sites = fields["sites"]
            self.sizes = loop.dim * sites, loop.dim * (fields["rows"] - 1 - sites)
            active = self._active if bonds.independent else None
            fields |= self._room(pieces) | {"travel": self._travel, "active": active}
            cuts = enumerate(pairwise(loop_layout.slices.balanced_cuts(pieces)))
            self._pieces = [
                SCENE(**fields, **_piece(loop_layout, *ends, k, pieces)) for k, ends in cuts
            ]
            fields |= _piece(loop_layout, 0, loop_layout.slices.tiles, 0, 1)
        else:  # fields of networks stay empty
            if bonds.stretch is not None:  # the image is no site
                self.sizes = u.size * len(bonds.inverse_mass) // len(u), 0
            active = self._active if bonds.stretch is None else None
            fields = dict.fromkeys(SCENE.kinds) | fields | {"active": active}
        self._bind(SCENE(**fields), method)
        self.set_step(dt)

    def _set_ranges(self, springs, range_at, seen=None):
        """Arrays in which the loop notes the smallest and the largest elongations."""
        counted = True if seen is None else np.repeat(seen, np.diff(range_at))
        self._springs = integers(np.where(counted, springs, -1))
        self._low, self._high = (aligned(len(springs), self._loop.dtype) for _ in range(2))
        self._no_range = np.tile([np.inf, -np.inf], (self._bonds.noted, 1))

    def _room(self, pieces):
        """Work arrays of the loop of a network."""
        fields, dtype, load = self._layout.fields, self._loop.dtype, self._bonds.contacts.load
        pull = aligned((pieces, len(load), ROW[self._loop.dim]), dtype)
        pull[..., : self._loop.dim] = load
        entries = fields["entry"][-1] if fields["cables"] else 0
        return {
            "near": np.zeros((2, self.u.size) if pieces > 1 else 0, dtype=dtype),
            "pull": pull,
            "press": np.zeros_like(fields["normal"]),
            "force": np.zeros(self.u[len(load) :].shape, dtype=dtype),
            "mean": np.zeros(entries, dtype=dtype),
            "least": np.zeros(entries, dtype=dtype),
            "average": np.zeros(2 * fields["cables"], dtype=dtype),
            "toward": np.zeros(self._loop.dim * len(fields["strand"]), dtype=dtype),
            "spread": np.zeros(0 if self._bonds.independent else self.u.size, dtype=dtype),
            "farthest": np.zeros(pieces, dtype=dtype),
            "gate": np.zeros(16, dtype=np.int64),
        }

    # methods

    def _bind(self, scene, method):
        """Prepare the steps of a method, and the structure that they take besides the scene."""
        self._scene, self._scaled_fields = scene, []
        self._scale_with_step(scene, "kicks", "drifts")
        kind, self._second = self._steps(method)
        self._advance, self._postprocess, stage = self._loop.steps(kind)
        scene.fill(stage=stage)
        self._addresses = [x and ctypes.addressof(x) for x in (scene, self._second)]
        self.output = np.empty_like(self.u), np.empty_like(self.v)
        self._library, self._march = march.compiled(), self._marched(self._advance)
        self._march_at = ctypes.addressof(self._march)

    def _marched(self, advance):
        """The structure `loop` of `march.c`, for a function that advances the loop."""
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
            low=self._low,
            high=self._high,
            spring=self._springs,
            active=self._active,
            size=self.u.size,
            sum_count=2,
            places=len(self._springs),
            actives=len(self._active),
            all_active=0 if self._loop.dim else np.iinfo(np.int64).max // 2,
        )

    def _steps(self, method):
        """The kind of a method's steps, and the structure that they take."""
        if isinstance(method, Splitting):
            return "", None
        if isinstance(method, Corrected):
            return "openings", self._corrections(method)
        if isinstance(method, Midpoint):
            if not self._bonds.independent:
                what = "bonds with mass" if self._bonds.cable is None else "cables over sites"
                raise TensegrityError(f"method {method.name!r}: not for {what}")
            if self._bonds.stretch is not None:
                raise TensegrityError(f"method {method.name!r}: not for rings")
            self._words = f"is too large for {method.name}: its equations were not solved in "
            return "implicit", self._equations()
        return "nystrom", self._accelerations(method)

    def _scale_with_step(self, structure, *names, power=1):
        """Register fields, given for a step of 1 s, that scale with a power of the step."""
        for name in names:
            array = structure.filled[name]
            self._scaled_fields.append((array, array.copy(), power))

    def set_step(self, dt):
        """Change the length of the steps [s]."""
        if dt == self._dt:
            return
        self._dt = None  # until all fields are scaled, in case of an interrupt
        factor = self._loop.dtype.type(dt)
        for array, of_one, power in self._scaled_fields:
            np.multiply(of_one, factor if power == 1 else factor**power, out=array)
        self._dt = dt

    def _accelerations(self, method):
        """Structure of the steps of a `Nystrom` method."""
        loop, rows = self._loop, ("nodes", "velocities", "matrix", "positions", "rates")
        steps = NYSTROM(
            **{name: np.array(getattr(method, name), dtype=loop.dtype) for name in rows},
            dt=np.ones(1, dtype=loop.dtype),
            place=np.zeros(self.u.size, dtype=loop.dtype),
            slopes=np.zeros((method.stages, self.u.size), dtype=loop.dtype),
            speed=np.zeros(self.u.size, dtype=loop.dtype),
            forcing=None,
            travel=self._travel,
            stages=method.stages,
            count=self.u.size,
            moving=self.sizes[0],
        )
        self._scale_with_step(steps, "nodes", "velocities", "rates", "dt")
        self._scale_with_step(steps, "matrix", "positions", power=2)
        return steps

    def _equations(self):
        """Structure of the steps of the implicit midpoint rule."""
        fields = implicit.fields(self._loop, self.u, self._bonds)
        steps = IMPLICIT(**fields, travel=self._travel)
        self._scale_with_step(steps, "dt")
        return steps

    def _corrections(self, method):
        """Structure of the steps of a method that corrects the loss of contacts."""
        loop, u = self._loop, self.u
        if loop.dim:
            self._scene.fill(**layout.of_contacts(loop, self._bonds))
        numbers = openings.contacts(self._bonds, loop.batch)
        numbers |= dict(zip(("nodes", "weights", "offsets"), method.rule, strict=True))
        row, spring = integers(numbers.pop("row")), numbers.pop("spring")
        bonds = row[0].size if spring is None else len(spring)
        count, numbers["dt"] = len(row) * bonds, [1.0]
        sizes = dict.fromkeys(("before", "rate_before", "after", "rate_after"), count)
        sizes |= dict.fromkeys(("u", "v", "end_u", "end_v", "end_a"), u.size)
        self._alone = steps = OPENINGS(
            **{name: loop.numbers(x) for name, x in numbers.items()},
            **{name: np.zeros(size, dtype=loop.dtype) for name, size in sizes.items()},
            row=row,
            spring=spring,
            springs=row[0].size,
            count=count,
            bonds=bonds,
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
        """Treat each step as one without neighbouring steps."""
        if self._alone is not None:
            self._alone.alone = 1

    # motion

    def restore(self, u, v):
        """Begin a motion in a state."""
        self.u[...], self.v[...] = u, v
        if self._bonds.cable is not None:
            self._scene.filled["toward"][:] = 0

    def go(self, done, end, wanted=()):
        """Advance from step `done` of a run to `end`, and store requested and final states; begins
        with `forget`.

        Parameters
        ----------
        done, end : int
        wanted : sequence of Wanted, optional
            For numbers of steps above `done` (or not below, if it is 0) and at most `end`.

        Returns
        -------
        int
            0; `STOPPED` where the loop stopped early, `NOT_FINITE` where the state is not finite.
        """
        rows = march.requests(wanted, *self.sizes)
        at = ctypes.addressof(rows)
        return self._library.go(self._march_at, done, end, at, len(wanted), self.sizes[0])

    def advance(self, steps, opened=False):
        """Advance u and v in place by whole steps with their closing kick; `opened`: other steps
        came before, which only corrected methods distinguish."""
        corrects = self._alone is not None
        self.advance_open(steps, opened and corrects)
        if self._postprocess is not None and not corrects:
            self._postprocess(*self._addresses, self.u.ctypes.data, self.v.ctypes.data)

    def advance_open(self, steps, opened):
        """Steps without the closing kick of the last one; if `opened`, they begin with that of the
        step before."""
        self._active[:] = 0
        self._active[0] = self._march.all_active
        if self._advance(*self._addresses, steps, opened):
            raise self.why_stopped()

    def why_stopped(self):
        """The error by which steps failed."""
        return StabilityError(
            f"dt {self._dt:.6g} s {self._words}{implicit.ITERATIONS} iterations; the springs "
            "change too much within a step"
        )

    def retune(self, bonds):
        """Continue with masses and parameters of other bonds of the same laws, in the same runs of
        a chain.  Arrays shared with other loops change too."""
        fields = parameters(bonds, self._layout.runs, self._loop.own, self._loop.batch)
        for name, values in (fields | {"w": bonds.inverse_mass}).items():
            self._scene.filled[name][:] = values

    def forget(self):
        """Reset the elongation ranges and the distance travelled."""
        self._library.begin(self._march_at)

    def widen(self, ranges):
        """Widen ranges of elongation, (springs, 2) [m], by those since `forget`, in place."""
        self._library.widen(self._march_at, address(ranges))
        return ranges

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since then [m], (springs, 2), or
        the ranges of coordinates; see `Bonds.noted`."""
        return self.widen(self._no_range.copy())

    @property
    def travel(self):
        """Bound on the distance that any coordinate of a site moved since then [m]; in networks."""
        return float(self._travel[0])


def stages(method, dt, dtype=np.float64):
    """Fields of a scene that depend on the method.

    Parameters
    ----------
    method : Method
    dt : float
        Step [s].
    dtype : numpy.dtype, optional

    Returns
    -------
    dict
        Kicks and drifts times dt, their number, and whether a step ends with a kick.
    """
    if isinstance(method, Corrected):
        method = method.base
    splitting = isinstance(method, Splitting)
    rows = (method.kicks, method.drifts) if splitting else ([0.0], [0.0])
    kicks, drifts = (np.multiply(x, dt, dtype=dtype) for x in rows)
    count = method.stages if splitting else 0
    return {"kicks": kicks, "drifts": drifts, "stages": count, "closing": int(kicks[-1] != 0)}


def _piece(laid, tile, last, number, pieces):
    """Fields for the tiles of a network that one thread advances, `tile` to `last` excluded."""
    return {
        "tile": tile,
        "last_tile": last,
        "before": laid.slices.needed[tile],
        "reach": laid.slices.reach[last],
        "piece": number,
        "pieces": pieces,
    }
