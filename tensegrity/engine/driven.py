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
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import codegen, forces, lanes
from tensegrity.engine.compiled import BoundLine, BoundNet, Compiled, structure_of
from tensegrity.engine.kernel import warn_slow
from tensegrity.engine.native import CompilerError
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from tensegrity.engine.bonds import Bonds
    from tensegrity.engine.codegen import Law
    from tensegrity.engine.methods import Splitting
    from tensegrity.typing import Array, Indices

FREE, APART, JOINED, TURNING = range(4)  # as in driven.c
LEAST_TERMS = 12  # of the series of a drift
NODES = 8  # instants of a drift from which prescribed velocities are taken as polynomials
SMALL = 1e-17  # first term of the series that is left out, relative
LARGEST_DAMPING = 2.0  # of a drift: time times the largest rate of decay

_DRIVE = structure_of(  # as in driven.c
    "_Drive",
    "moved_u moved_v force force_rate shared domain heavy series rubbed decay glide mass ground "
    "bond moved forced term next pull given sums ends apart room stretch",
    "entries moving forcing damped degree joined levels bonds",
)


@dataclass(frozen=True)
class Change:
    """Rate of a law's energy in time, at given elongation, as a law of its own.

    Attributes
    ----------
    law : Law
        Its parameters, and then their rates, are those of the change.
    moving : tuple of int, optional
        Numbers of the parameters whose rates are not 0; by default all.
    """

    law: Law
    moving: tuple[int, ...] | None = None
    split = False
    compiled = ("energy",)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Those of the law, and their rates."""
        return tuple(f"{kind}{k}" for kind in "pq" for k in range(len(self.law.parameters)))

    @property
    def name(self) -> str:
        """What stands for it in other processes, if anything does."""
        name = getattr(self.law, "name", "")
        return f"change with {self.moving} of {name}" if name else ""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The change in CasADi, by automatic differentiation; see `codegen.Law.forms`."""
        import casadi as ca

        r, p, forms = self.law.forms()
        rates = ca.SX.sym("rates", p.numel())
        moving = range(p.numel()) if self.moving is None else self.moving
        along = ca.vertcat(*(rates[k] if k in moving else 0 for k in range(p.numel())))
        changes = [ca.jtimes(form, p, along) for form in forms]
        return r, ca.vertcat(p, rates), changes

    def both(self) -> Any:
        """CasADi function (r, parameters) -> tension of the law, rate of its energy."""
        import casadi as ca

        tension = codegen.functions(self.law)["tension"]
        change = codegen.functions(self)["energy"]
        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        return ca.Function("both", [r, p], [tension(r, p[: p.numel() // 2]), change(r, p)])


@dataclass(frozen=True, eq=False)
class Forcing:
    """What time does to a scene, as its loop takes it.

    Entries are those of u, one after the other.

    Attributes
    ----------
    bonds : Bonds
        Of the scene.
    moved, forced : ndarray of int
        Entries whose motion is prescribed, and those that get a force.
    motion, force : callable (t, order) -> ndarray, (t.size, entries)
        Displacements [m], forces [N], and their rates for order 1.
    mass : ndarray, (entries,)
        [kg]; 0 where the motion is prescribed.
    heavy : ndarray, (moved,)
        Masses there [kg].
    ground : ndarray, (entries,)
        Dashpots to the ground [N s/m].
    bond : ndarray, (bonds,)
        Dashpots in the bonds [N s/m]; not in contacts with walls, which stand behind the bonds.
    tuning : object or None
        Springs that change: `law`, the numbers of parameters that are `moving`, `at(t)` and
        `numbers(t)`, rows for each of t.
    """

    bonds: Bonds
    moved: Indices
    forced: Indices
    motion: Callable[[Array, int], Array]
    force: Callable[[Array, int], Array]
    mass: Array
    heavy: Array
    ground: Array
    bond: Array
    tuning: Any

    @property
    def damped(self) -> int:
        """What dashpots there are, as `driven.c` counts."""
        if self.bond.any():
            return JOINED if self.bonds.contacts is None else TURNING
        return APART if self.ground.any() else FREE

    @property
    def contacts(self) -> Any:
        """Those of the bonds of a network."""
        return self.bonds.contacts

    @property
    def joined(self) -> Indices:
        """Numbers of the bonds of a network that have dashpots."""
        return np.flatnonzero(self.bond) if self.damped == TURNING else np.zeros(0, dtype=int)

    @property
    def decay(self) -> float:
        """Bound on the rates at which velocities decay by dashpots [1/s]."""
        total = self.ground.copy()
        if self.damped == JOINED:
            total[1:] += 2 * self.bond
            total[:-1] += 2 * self.bond
        elif self.damped == TURNING:
            by_site = total.reshape(len(self.contacts.load), -1)  # a view
            for ends in (self.contacts.first, self.contacts.second):
                np.add.at(by_site, ends[self.joined], 2 * self.bond[self.joined, None])
        weights = np.divide(1, self.mass, out=np.zeros_like(total), where=self.mass > 0)
        return float(np.max(total * weights, initial=0.0))


class Schedule:
    """Rows of numbers for all kicks and drifts of some steps, from their times alone.

    Parameters
    ----------
    forcing : Forcing
    method : Splitting
    dt : float
        [s]
    """

    def __init__(self, forcing: Forcing, method: Splitting, dt: float) -> None:
        self._forcing, self._dt = forcing, dt
        self.kicks, self.drifts = (np.multiply(x, dt) for x in (method.kicks, method.drifts))
        self._within = np.concatenate([[0.0], np.cumsum(self.drifts)])
        self._whole = round(sum(method.drifts)) == 1  # not so where it leads to other variables
        self._within[-1] = dt * self._whole
        self.degree, self.levels = self._terms(), -(-method.order // 2)
        nodes = (1 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)) / 2
        self._nodes, self._solve = nodes, np.linalg.inv(np.vander(nodes, increasing=True))
        self._gauss, self._weights = np.polynomial.legendre.leggauss(NODES)

    def _terms(self) -> int:
        """Terms of the series of a drift that count."""
        if self._forcing.damped != JOINED:
            return LEAST_TERMS
        size, term, count = float(np.abs(self.drifts).max()) * self._forcing.decay, 1.0, 0
        while term > SMALL or count < LEAST_TERMS:
            count += 1
            term *= size / count
        return count

    def times(self, first: int, steps: int, origin: float = 0.0) -> Array:
        """Instants of the kicks, and of the end [s]; (steps stages + 1,)."""
        starts = origin + self._dt * np.arange(first, first + steps + 1)
        each = starts[:-1, None] + self._within[:-1]
        last = starts[-1] if self._whole else origin + self._within[-1]
        return np.append(each.ravel(), last)

    def width(self) -> int:
        """Numbers that a step takes."""
        forcing, width = self._forcing, 1
        width += len(forcing.moved) * (2 + self.degree * (1 + (forcing.damped > 0)))
        width += 2 * len(forcing.forced)
        if forcing.tuning is not None:
            width += 4 * forcing.bonds.parameters.shape[1]
        return width * len(self.drifts)

    def rows(self, first: int, steps: int, origin: float = 0.0) -> dict[str, Array]:
        """The arrays of `driven.c` that depend on time, from step `first` after `origin` on."""
        forcing, at = self._forcing, self.times(first, steps, origin)
        found = {}
        if forcing.moved.size:
            found["moved_u"] = forcing.motion(at[1:], 0)
            found["moved_v"] = forcing.motion(at, 1)
            if forcing.damped:
                found |= self._between(at, steps)
        if forcing.forced.size:
            found["force"], found["force_rate"] = (forcing.force(at, k) for k in (0, 1))
        if forcing.tuning is not None:
            found["shared"], found["domain"] = forcing.tuning.numbers(at)
        return {name: np.ascontiguousarray(rows, dtype=float) for name, rows in found.items()}

    def _between(self, at: Array, steps: int) -> dict[str, Array]:
        """Prescribed velocities within drifts: as polynomials, or what they lose by rubbing."""
        starts, lengths = at[:-1], np.tile(self.drifts, steps)
        moved, ground = self._forcing.moved, self._forcing.ground
        if self._forcing.damped >= JOINED:
            nodes = starts[:, None] + lengths[:, None] * self._nodes
            values = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved))
            series = np.zeros((len(starts), len(moved), self.degree))
            series[..., :NODES] = np.einsum("kx,sxm->smk", self._solve, values)
            return {"series": series}
        nodes = starts[:, None] + lengths[:, None] * (1 + self._gauss) / 2
        squares = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved)) ** 2
        return {"rubbed": lengths * ((squares @ ground[moved]) @ self._weights) / 2}


class Locked(Exception):  # no error of a user's: which stage it was
    """A spring of a chain whose springs change reached an end of its domain.

    Parameters
    ----------
    t : float
        When [s].
    range : ndarray, (2,)
        Smallest and largest elongation of that stage and those before [m].
    """

    def __init__(self, t: float, range: Array) -> None:
        self.t, self.range = t, range


class _Bound:
    """Arrays u and v with what was done on them.

    Attributes
    ----------
    sums : ndarray, (4,)
        Work of drivers [J], without what their masses and forces store; loss in dashpots [J];
        smallest and largest elongation met, where springs change [m].
    """

    def __init__(self, forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float) -> None:
        self._forcing, self._u, self.v = forcing, u, v
        self.schedule = Schedule(forcing, method, dt)
        self.sums = np.array([0.0, 0.0, np.inf, -np.inf])
        drifts, weights = self.schedule.drifts, 1 / np.where(forcing.mass, forcing.mass, 1.0)
        self._decay = np.exp(-drifts[:, None] * forcing.ground * weights)
        rates = forcing.ground * weights * np.ones_like(drifts)[:, None]
        glide = drifts[:, None] * np.ones_like(rates)
        np.divide(-np.expm1(-drifts[:, None] * rates), rates, out=glide, where=rates != 0)
        self._glide = np.ascontiguousarray(glide)

    def forget(self) -> None:
        """Start anew to record elongations; work and loss stay."""
        self.sums[2:] = np.inf, -np.inf


class BoundDriven(_Bound):
    """Advanced by compiled steps."""

    def __init__(
        self, loop: Any, forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float
    ) -> None:
        super().__init__(forcing, u, v, method, dt)
        kind = BoundNet if loop.dim else BoundLine
        self._bound, self._loop = kind(loop, u, v, forcing.bonds, method, dt), loop
        entries, degree = len(forcing.mass), self.schedule.degree
        fixed = {
            "decay": self._decay, "glide": self._glide, "mass": forcing.mass,
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
        super().forget()
        self._bound.forget_range()  # type: ignore[no-untyped-call]

    @property
    def travel(self) -> float:
        """Bound on how far any coordinate of a site moved since `forget` [m]; of networks."""
        return self._bound.travel

    @property
    def range(self) -> Array:
        """Smallest and largest elongation of each spring since `forget`; (springs, 2)."""
        return self._bound.range if self._forcing.tuning is None else self.sums[2:][None].copy()


class BoundPlain(_Bound):
    """The same steps in NumPy, where there is no compiler: slow, and a check of the others."""

    def __init__(
        self, loop: Any, forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float
    ) -> None:
        super().__init__(forcing, u, v, method, dt)
        self._loop, self.travel = loop, 0.0
        self._low, self._high = np.full((2, len(forcing.bonds.law)), np.inf)
        self.forget()

    def forget(self) -> None:
        super().forget()
        self._low[:], self._high[:], self.travel = np.inf, -np.inf, 0.0

    @property
    def range(self) -> Array:
        """As `BoundDriven.range`."""
        return np.stack([self._low, self._high], axis=1)

    def advance(
        self, first: int, steps: int, opened: bool, close: bool, origin: float = 0.0
    ) -> None:
        """As `BoundDriven.advance`."""
        schedule, given = self.schedule, (first, max(steps, 1), origin)
        rows, times = schedule.rows(*given), schedule.times(*given)
        (*kicks, closing), drifts = schedule.kicks, schedule.drifts
        s = 0
        for step in range(steps):
            for i, (kick, drift) in enumerate(zip(kicks, drifts, strict=True)):
                merged = closing if i == 0 and (step or opened) else 0.0
                self._stage(rows, times, s, i, kick + merged, drift)
                s += 1
        if close and closing:
            self._stage(rows, times, s, 0, closing, 0.0)

    def _stage(self, rows: Any, times: Any, s: int, i: int, a: float, b: float) -> None:
        forcing, sums = self._forcing, self.sums
        u, v = self._u.reshape(-1), self.v.reshape(-1)  # views
        moved, forced = forcing.moved, forcing.forced
        pull = self._pull(rows, times, s, a)
        weights = forcing.bonds.inverse_mass
        if forcing.bonds.contacts is not None:
            weights = forcing.bonds.contacts.weights(weights)
        weights = weights.reshape(-1)
        if forced.size:
            sums[0] -= a * np.sum(rows["force_rate"][s] * u[forced])
            pull[forced] += rows["force"][s]
        if moved.size:
            sums[0] -= a * np.sum(pull[moved] * rows["moved_v"][s])
        v += a * weights * pull
        v[moved] = 0
        count = len(forcing.mass)
        u, v = u[:count], v[:count]  # without walls, which stay
        if not b:
            return
        before, old = np.sum(forcing.mass * v**2) / 2, u.copy()
        if forcing.damped == FREE:
            u += b * v
        elif forcing.damped == APART:
            u += self._glide[i] * v
            v *= self._decay[i]
            if moved.size:
                sums[:2] += rows["rubbed"][s]
        else:
            drift = self._joined if forcing.damped == JOINED else self._turning
            sums[:2] += drift(rows["series"][s] if moved.size else None, u, v, b, weights)
        if forcing.damped:
            sums[1] += before - np.sum(forcing.mass * v**2) / 2
        if moved.size:
            u[moved] = rows["moved_u"][s]
        self.travel += float(np.max(np.abs(u - old)))

    def _pull(self, rows: Any, times: Any, s: int, a: float) -> Array:
        """Forces of the bonds on all entries, watched."""
        forcing, bonds = self._forcing, self._forcing.bonds
        parameters = bonds.parameters
        shape = self._u if bonds.contacts is not None else self._u.reshape(-1)
        r, along = forces.elongations(bonds, shape)
        if forcing.tuning is not None:
            parameters = rows["shared"][s][None]
            change = self._loop.evaluate(1, 0, parameters[0], np.ascontiguousarray(r))
            self.sums[0] += a * np.sum(change)
        np.minimum.at(self._low, bonds.group, r)
        np.maximum.at(self._high, bonds.group, r)
        if forcing.tuning is not None:
            self.sums[2:] = self._low[0], self._high[0]
            low, high = rows["domain"][s]
            if not (r.min() > low and r.max() < high):
                raise Locked(float(times[s]), np.array([r.min(), r.max()]))
        tension = np.zeros_like(r)
        for k in np.unique(bonds.group):
            mine = np.flatnonzero(bonds.group == k)
            part = np.ascontiguousarray(r[mine])
            tension[mine] = self._loop.evaluate(int(bonds.law[k]), 1, parameters[k], part)
        pull = forces.pulls(bonds, tension, along)
        if bonds.contacts is not None:
            pull[: len(bonds.contacts.load)] += bonds.contacts.load
        return pull.reshape(-1)

    def _joined(self, series: Any, u: Array, v: Array, b: float, weights: Array) -> float:
        """A drift with dashpots in bonds; returns what whoever moves sites pays."""
        forcing, y, total = self._forcing, v.copy(), 0.0
        v[:] = 0
        given = []
        for k in range(self.schedule.degree):
            if series is not None:
                y[forcing.moved] = series[:, k]
            pull = np.diff(forcing.bond * np.diff(y), prepend=0.0, append=0.0) - forcing.ground * y
            given.append(-pull[forcing.moved])
            v += y
            u += b / (k + 1) * y
            y = b / (k + 1) * weights * pull
        if series is not None:
            each = np.arange(self.schedule.degree)
            share = b / (each[:, None] + each + 1)
            total = float(np.einsum("mk,lm,kl->", series, np.array(given), share))
        return total

    def _turning(self, series: Any, u: Array, v: Array, b: float, weights: Array) -> float:
        """The same in a network, as `drift_turning` of `driven.c`."""
        forcing, bonds, moved = self._forcing, self._forcing.bonds, self._forcing.moved
        n = len(forcing.mass)
        shape = -1, bonds.dim
        weights = weights[:n].copy()
        weights[moved] = 0

        def rate(y: Array, tau: float) -> Array:
            if series is not None:
                y[n : 2 * n][moved] = np.polynomial.polynomial.polyval(tau, series.T)
            rows = y[n : 2 * n].reshape(shape)
            along = forces.elongations(bonds, y[:n].reshape(shape))[1][forcing.joined]
            ends = [x[forcing.joined] for x in (forcing.contacts.first, forcing.contacts.second)]
            apart = rows[ends[1]] - rows[ends[0]]
            speed = forcing.bond[forcing.joined] * np.sum(along * apart, axis=1)
            pull = -(forcing.ground.reshape(shape) * rows)
            np.add.at(pull, ends[0], speed[:, None] * along)
            np.subtract.at(pull, ends[1], speed[:, None] * along)
            paid = -np.sum(y[n : 2 * n][moved] * pull.ravel()[moved])
            return np.concatenate([y[n : 2 * n], weights * pull.ravel(), [paid]])

        table: list[Array] = []
        for level in range(self.schedule.levels):
            steps = 2 * (level + 1)
            h, old = b / steps, np.concatenate([u, v, [0.0]])
            now = old + h * rate(old, 0.0)
            for k in range(1, steps):
                old, now = now, old + 2 * h * rate(now, k / steps)
            now = (old + now + h * rate(now, 1.0)) / 2
            for k in range(level):
                share = 1 / (((level + 1) / (level - k)) ** 2 - 1)
                table[k], now = now, now + share * (now - table[k])
            table.append(now)
        u[:], v[:] = now[:n], now[n : 2 * n]
        v[moved] = 0
        return float(now[-1])


class DrivenLoop(Compiled):
    """Laws, their loop, and behind it steps in which time counts.

    Parameters
    ----------
    laws : tuple of Law
        Where springs change, the one law and its `Change`.
    own, dim
        As those of `Compiled`.
    """

    kind = "driven"

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
        if self.dim or codegen.is_long(law.law):
            return "#define CHANGE\n#define change(r, p) energy_1(r, p)", "driven.c"
        p = [f"wide(p[{k}])" for k in range(len(law.parameters))]
        arguments = "const pack *r, const real *p, pack *f, pack *rate"
        both = lanes.text(law.both(), "both", arguments, [["r[g]"], p], [["f[g]"], ["rate[g]"]])
        return f"#define CHANGE\n#define BOTH\n{both}", "driven.c"


@once
def _loop(laws: Any, own: Any, dim: int) -> Any:
    try:
        return DrivenLoop(laws, own, dim)
    except CompilerError as error:
        from tensegrity.engine.interpreted import Interpreted

        warn_slow(str(error))
        return Interpreted(laws)


def bind(forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float) -> Any:
    """Prepare rows `u` and `v` of a driven scene, which are advanced in place."""
    bonds = forcing.bonds
    laws, own = bonds.laws, bonds.own
    if forcing.tuning is not None:
        laws, own = (laws[0], Change(laws[0], forcing.tuning.moving)), (None, None)
    loop = _loop(laws, own, bonds.dim)
    kind = BoundDriven if isinstance(loop, DrivenLoop) else BoundPlain
    return kind(loop, forcing, u, v, method, dt)
