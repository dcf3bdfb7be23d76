"""Steps of a splitting in which time counts: driven sites, dashpots, springs that change.

Time is one more coordinate, which drifts advance: the kick of a stage uses the forces, the
prescribed places and the springs of its instant, and a splitting keeps its order.  What a driver
does is the change of time's conjugate momentum, summed with the method's own kicks.  A drift with
dashpots, u' = v, m v' = -G v, is linear in v and solved exactly, on a line; so the commutators that
the order of a Nystrom splitting needs to vanish still do, and it is kept.  Where bonds of a network
turn, G follows u: they vanish as well, and the drift is solved to the order of the method.  See
`driven.c`.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import lanes
from tensegrity.engine.bound_line import BoundLine
from tensegrity.engine.bound_net import BoundNet
from tensegrity.engine.codegen import is_long
from tensegrity.engine.compiled import Compiled, structure_of
from tensegrity.engine.timed import TURNING, Change, Forcing, Locked, Schedule
from tensegrity.once import once

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.methods import Splitting
    from tensegrity.typing import Array, Indices

_DRIVE = structure_of(  # as in driven.c
    "_Drive",
    "moved_u moved_v force force_rate shared domain heavy series rubbed decay glide mass ground "
    "bond moved forced term next pull given sums ends apart room stretch",
    "entries moving forcing damped degree joined levels bonds",
)


class BoundDriven:
    """Arrays u and v, advanced in place, with what was done on them.

    Attributes
    ----------
    sums : ndarray, (4,)
        Work of drivers [J], without what their masses and forces store; loss in dashpots [J];
        smallest and largest elongation met, where springs change [m].
    """

    def __init__(
        self, loop: Any, forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float
    ) -> None:
        self._forcing, self._u, self.v = forcing, u, v
        self.schedule = Schedule(forcing, method, dt)
        self.sums = np.array([0.0, 0.0, np.inf, -np.inf])
        drifts, weights = self.schedule.drifts, 1 / np.where(forcing.mass, forcing.mass, 1.0)
        rates = forcing.ground * weights * np.ones_like(drifts)[:, None]
        glide = drifts[:, None] * np.ones_like(rates)
        np.divide(-np.expm1(-drifts[:, None] * rates), rates, out=glide, where=rates != 0)
        kind = BoundNet if loop.dim else BoundLine
        self._bound, self._loop = kind(loop, u, v, forcing.bonds, method, dt), loop
        entries, degree = len(forcing.mass), self.schedule.degree
        fixed = {
            "decay": np.exp(-drifts[:, None] * forcing.ground * weights), "glide": glide,
            "mass": forcing.mass,
            "heavy": forcing.heavy,
            "ground": forcing.ground, "bond": forcing.bond,
            "moved": forcing.moved.astype(np.int64), "forced": forcing.forced.astype(np.int64),
            "term": np.zeros(entries), "next": np.zeros(entries), "pull": np.zeros(entries + 1),
            "given": np.zeros((len(forcing.moved) + 1, degree)), "sums": self.sums,
            "stretch": np.zeros(len(forcing.bonds.group)),
        }  # fmt: skip
        if forcing.damped == TURNING:
            of, joined = forcing.contacts, forcing.joined
            fixed |= {
                "bond": forcing.bond[joined], "apart": of.geometry[:, joined].T,
                "ends": loop.dim * np.stack([of.first, of.second], axis=1)[joined].astype(np.int64),
                "room": np.zeros((self.schedule.levels + 3, 2 * entries + 1)),
            }  # fmt: skip
        self._arrays = {name: np.ascontiguousarray(x) for name, x in fixed.items()}
        self._drive = _DRIVE()
        for name, x in self._arrays.items():
            setattr(self._drive, name, x.ctypes.data)
        counts = (
            entries, len(forcing.moved), len(forcing.forced), forcing.damped, degree,
            len(forcing.joined), self.schedule.levels, len(forcing.bonds.group),
        )  # fmt: skip
        for (name, _), count in zip(_DRIVE._fields_[-len(counts) :], counts, strict=True):
            setattr(self._drive, name, count)

    def advance(
        self, first: int, steps: int, opened: bool, close: bool, origin: float = 0.0
    ) -> None:
        """Whole steps from step `first` after `origin` [s] on; a first kick includes the last one
        of the steps before if `opened`, and the own last one is left out unless `close`.

        Raises
        ------
        Locked
            A spring that changes met an end of its domain; u and v are of no use then.
        """
        rows = self.schedule.rows(first, max(steps, 1), origin)
        for name, x in rows.items():
            setattr(self._drive, name, x.ctypes.data)
        stage = self._loop.advance_driven(
            self._bound.address, ctypes.addressof(self._drive), steps, opened, close
        )
        if stage >= 0:
            times = self.schedule.times(first, max(steps, 1), origin)
            raise Locked(float(times[stage]), self.sums[2:].copy())

    def go(
        self, out: BoundDriven, first: int, at: Indices, opened: bool, sites: int, walls: int
    ) -> tuple[Array, Array, Array, Array]:
        """Go on from step `first` with a row at each of so many steps from there, by copies in
        `out`.

        Returns
        -------
        u, v, impulse, sums : ndarray
            (rows, sites[, dim]) twice, (rows, walls[, dim]), (rows, 2); v of what is moved is 0.

        Raises
        ------
        Locked
        """
        rows, count = self.schedule.rows(first, int(at[-1])), len(at)
        for name, x in rows.items():
            setattr(self._drive, name, x.ctypes.data)
        shape = self._u.shape[1:]
        per = int(np.prod(shape))
        u, v = np.empty((2, count, sites, *shape))
        more, sums = np.empty((count, walls, *shape)), np.empty((count, 2))
        at = np.ascontiguousarray(at, dtype=np.int64)
        stage = self._loop.rows_driven(
            self._bound.address, ctypes.addressof(self._drive), out._bound.address,
            at.ctypes.data, count, opened, self._u.size, sites * per, walls * per,
            *(x.ctypes.data for x in (u, v, more, sums)),
        )  # fmt: skip
        if stage >= 0:
            times = self.schedule.times(first, int(at[-1]))
            raise Locked(float(times[stage]), self.sums[2:].copy())
        return u, v, more, sums

    def forget(self) -> None:
        """Start anew to record elongations; work and loss stay."""
        self.sums[2:] = np.inf, -np.inf
        self._bound.forget_range()  # type: ignore[no-untyped-call]

    @property
    def travel(self) -> float:
        """Bound on how far any coordinate of a site moved since `forget` [m]; of networks."""
        return self._bound.travel

    @property
    def range(self) -> Array:
        """Smallest and largest elongation of each spring since `forget`; (springs, 2)."""
        return self._bound.range if self._forcing.tuning is None else self.sums[2:][None].copy()


class DrivenLoop(Compiled):
    """Laws, their loop, and behind it steps in which time counts.

    Parameters
    ----------
    laws : tuple of Law
        Where springs change, the one law and its `Change`.
    own, dim
        As those of `Compiled`.
    """

    kind, corrects = "driven", False

    def __init__(self, laws: Any, own: Any, dim: int) -> None:
        super().__init__(laws, own, dim)  # type: ignore[no-untyped-call]
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for name, arguments in (
            ("advance_driven", [address] * 2 + [number] * 3),
            ("rows_driven", [address] * 4 + [number] * 5 + [address] * 4),
        ):
            function = self.library[name]
            function.argtypes, function.restype = arguments, number
            setattr(self, name, function)

    @property
    def extra(self) -> Any:  # type: ignore[override]
        """Behind the loop: what springs that change need, and the steps."""
        law = self.laws[-1]
        if not isinstance(law, Change):
            return ("driven.c",)
        if self.dim or is_long(law.law):
            return "#define CHANGE\n#define change(r, p) energy_1(r, p)", "driven.c"
        p = [f"wide(p[{k}])" for k in range(len(law.parameters))]
        arguments = "const pack *r, const real *p, pack *f, pack *rate"
        both = lanes.text(law.both(), "both", arguments, [["r[g]"], p], [["f[g]"], ["rate[g]"]])
        return f"#define CHANGE\n#define BOTH\n{both}", "driven.c"


@once
def _loop(laws: Any, own: Any, dim: int) -> DrivenLoop:
    return DrivenLoop(laws, own, dim)


def bind(forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float) -> BoundDriven:
    """Prepare rows `u` and `v` of a driven scene, which are advanced in place."""
    bonds = forcing.bonds
    laws, own = bonds.laws, bonds.own
    if forcing.tuning is not None:
        laws, own = (laws[0], Change(laws[0], forcing.tuning.moving)), (None, None)
    return BoundDriven(_loop(laws, own, bonds.dim), forcing, u, v, method, dt)
