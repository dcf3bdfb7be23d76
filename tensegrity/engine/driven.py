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

from tensegrity.engine import march
from tensegrity.engine.bound_line import BoundLine
from tensegrity.engine.bound_net import BoundNet
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.law import Change
from tensegrity.engine.structs import structure
from tensegrity.engine.timed import ROWS, TURNING, Forcing, Locked, Schedule
from tensegrity.once import once

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.methods import Splitting
    from tensegrity.typing import Array

DRIVE = structure("driven.c", "drive")


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
        self._forcing, self.u, self.v = forcing, u, v
        self.schedule = Schedule(forcing, method, dt)
        self.sums = np.array([0.0, 0.0, np.inf, -np.inf])
        self.shown_sums = self.sums.copy()
        drifts, weights = self.schedule.drifts, 1 / np.where(forcing.mass, forcing.mass, 1.0)
        rates = forcing.ground * weights * np.ones_like(drifts)[:, None]
        glide = drifts[:, None] * np.ones_like(rates)
        np.divide(-np.expm1(-drifts[:, None] * rates), rates, out=glide, where=rates != 0)
        kind = BoundNet if loop.dim else BoundLine
        self._bound, self._loop = kind(loop, u, v, forcing.bonds, method, dt), loop
        self.sizes, self.shown = self._bound.sizes, self._bound.shown
        entries, degree, levels = len(forcing.mass), self.schedule.degree, self.schedule.levels
        moving, bonds = len(forcing.moved), len(forcing.bonds.group)
        sizes = {"term": entries, "next": entries, "pull": entries + 1, "stretch": bonds}
        arrays = {name: np.zeros(size) for name, size in sizes.items()}
        arrays |= {name: getattr(forcing, name) for name in ("mass", "heavy", "ground", "bond")}
        arrays |= {name: getattr(forcing, name).astype(np.int64) for name in ("moved", "forced")}
        arrays |= {"decay": np.exp(-drifts[:, None] * forcing.ground * weights), "glide": glide}
        arrays |= {"sums": self.sums, "shown": self.shown_sums}
        arrays["given"] = np.zeros((moving + 1, degree))
        if forcing.damped == TURNING:
            of, joined = forcing.contacts, forcing.joined
            ends = loop.dim * np.stack([of.first, of.second], axis=1)[joined]
            arrays |= {
                "bond": forcing.bond[joined],
                "apart": of.geometry[:, joined].T,
                "ends": ends.astype(np.int64),
                "room": np.zeros((levels + 3, 2 * entries + 1)),
            }
        later = dict.fromkeys((*ROWS, "ends", "apart", "room"))
        self._drive = DRIVE(
            **later | {name: np.ascontiguousarray(x) for name, x in arrays.items()},
            entries=entries,
            moving=moving,
            forcing=len(forcing.forced),
            damped=forcing.damped,
            degree=degree,
            joined=len(forcing.joined),
            levels=levels,
            bonds=bonds,
            stage=0,
        )
        functions = loop.advance_driven, loop.show_driven
        self._march = self._bound.loop_of(functions, self._drive, self.shown_sums)  # type: ignore[no-untyped-call]

    def go(self, done: int, end: int, wanted: Any = ()) -> int:
        """As `Bound.go`; velocities of what is moved are 0, and sums lack what masses and forces of
        drivers store.

        Raises
        ------
        Locked
            A spring that changes met an end of its domain; u and v are of no use then.
        """
        return self._advance(
            done, end - done, lambda: march.go(self._march, done, end, wanted, *self.sizes)
        )

    def short(self, t: float) -> None:
        """One step alone that begins at t [s], in place, and closed."""
        function, addresses = self._loop, (self._bound.address, ctypes.addressof(self._drive))

        def step() -> Any:
            u, v = (x.ctypes.data for x in (self.u, self.v))
            stopped = function.advance_driven(*addresses, 1, False)
            return stopped or function.show_driven(*addresses, u, v)

        self._advance(0, 1, step, t)
        self.sums[:] = self.shown_sums

    def _advance(self, first: int, steps: int, do: Any, origin: float = 0.0) -> int:
        """Do steps from number `first` after `origin` [s] on."""
        self._drive.fill(**self.schedule.rows(first, max(steps, 1), origin))
        self._drive.stage, self.shown_sums[:] = 0, self.sums
        found = do()
        if found == march.STOPPED:
            times = self.schedule.times(first, steps, origin)
            raise Locked(float(times[self._drive.stage]), self.sums[2:].copy())
        return found

    def forget_range(self) -> None:
        """Start anew to record elongations; work and loss stay."""
        self.sums[2:] = np.inf, -np.inf
        self._bound.forget_range()  # type: ignore[no-untyped-call]

    @property
    def travel(self) -> float:
        """Bound on how far any coordinate of a site moved since `forget_range` [m]; of networks."""
        return self._bound.travel

    @property
    def range(self) -> Array:
        """Smallest and largest elongation of each spring since `forget_range`; (springs, 2)."""
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
    extra = ("driven.c",)

    def __init__(self, laws: Any, own: Any, dim: int) -> None:
        super().__init__(laws, own, dim)  # type: ignore[no-untyped-call]
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for name, arguments in (
            ("advance_driven", [address] * 2 + [number] * 2),
            ("show_driven", [address] * 4),
        ):
            function = self.library[name]
            function.argtypes, function.restype = arguments, number
            setattr(self, name, function)


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
