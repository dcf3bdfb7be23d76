"""Springs that change with time: their arguments are functions of it; in the form of the compiled
loop.

The parameters of the law are represented by Chebyshev series in the arguments, over the range of
these in a run; the series stay short however fast the change is, and the rates follow by the chain
rule.  A prism, and a contact under a preload, is measured from an equilibrium that depends on the
arguments: elongations refer to that at t = 0, and the law is shifted accordingly.  The series are
verified against the springs between their nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import chebyshev

from tensegrity.engine.compiled import evaluated, loop_of_law
from tensegrity.engine.law import Change, Law
from tensegrity.errors import LockingError, ResolutionError, TensegrityError
from tensegrity.springs.varied import OverTime
from tensegrity.typing import Array, Indices

if TYPE_CHECKING:
    from tensegrity.springs.collection import Springs
    from tensegrity.springs.potential import Potential

SIZES = (5, 9, 17, 33, 65)  # nodes of the series in each argument
TEST_POINTS = np.array([-0.99, -0.437, 0.211, 0.683, 0.97])  # of the ranges, between the nodes
MOST_NODES = 1100  # largest number of nodes in all arguments
WIDER = 1e-3  # extension of an argument's range on either side, over the range
CONSTANT = 1e-14  # relative change of a parameter that is round-off
GOOD, MISFIT = 1e-13, 1e-11  # relative error of the tension: sufficient, and largest admissible
SAMPLES = 2001  # times at which the range of an argument is sampled
HALVINGS = 50  # bisections for the time at which a spring ceases to exist
FRACTIONS = np.array([0.02, 0.2, 0.5, 0.8, 0.95])  # test elongations, over the ends of the domain


@dataclass(frozen=True)
class Shifted:
    """A law with one more parameter, a shift that is added to the elongation.

    Attributes
    ----------
    law : Law
    """

    law: Law

    @property
    def compiled(self) -> Any:
        """Names of the compiled functions of the law."""
        return self.law.compiled

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the law's parameters, followed by "shift"."""
        return (*map(str, self.law.parameters), "shift")

    @property
    def name(self) -> str:
        """Name of the law in other processes, or "" if it has none."""
        return f"shifted {name}" if (name := getattr(self.law, "name", "")) else ""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation, parameters and forms of the shifted law in CasADi; see `law.Law.forms`."""
        import casadi as ca

        r, p, forms = self.law.forms()
        shift = ca.SX.sym("shift")
        return r, ca.vertcat(p, shift), ca.substitute(list(forms), [r], [r + shift])


NO_END = 1e300  # m: stands for an infinite end of the domain in a series


def finite_ends(ends: Array) -> Array:
    """Ends of domains from the values of their series, infinite beyond 0.9 NO_END."""
    return np.where(np.abs(ends) < 0.9 * NO_END, ends, np.copysign(np.inf, ends))


class Series:
    """The parameters of a spring's law, and the ends of its domain, as functions of time.

    Parameters
    ----------
    spring : Potential
        Which may change.
    t_end : float
        End of the run [s].

    Attributes
    ----------
    law : Law
        The law whose parameters change.
    until : float
        Time at which the spring ceases to exist [s]; inf if it exists throughout.
    reason : TensegrityError or None
        The error of the spring at that time.

    Raises
    ------
    ResolutionError
        The spring changes too abruptly for the longest series.
    TensegrityError
        Springs of different laws, or measured from different reference shapes.
    """

    until: float = np.inf
    reason: TensegrityError | None = None

    def __init__(self, spring: Potential, t_end: float) -> None:
        self._given, self._first, self._t_end = spring, spring.at(0.0), t_end
        self._signals = spring.law.signals if isinstance(spring.law, OverTime) else {}
        if self._signals:
            self.law, self.series, self._low, self._half = self._fit(*self._argument_ranges())
        else:
            self.law, self.series = self._tabulated([spring])
        flat = np.abs(self.series.reshape(-1, self.series.shape[-1]))
        self._moves = flat[1:].max(axis=0, initial=0.0) > 0  # the other series are constant
        self._all = _with_rates(self.series[..., self._moves])

    @property
    def moving(self) -> tuple[int, ...]:
        """Indices of the parameters that change."""
        return tuple(np.flatnonzero(self._moves[:-2]).tolist())

    def _arguments(self, t: Array, order: int) -> Array:
        """Arguments at times t, or their rates for order 1; (t.size, arguments)."""
        return np.stack([np.asarray(f(t, order)) for f in self._signals.values()], axis=-1)

    def _spring(self, arguments: Array) -> Potential:
        return self._first.varied(dict(zip(self._signals, arguments.tolist(), strict=True)))

    def _argument_ranges(self) -> tuple[Array, Array]:
        """Lowest and highest arguments, up to the time at which the spring ceases to exist."""
        while True:
            end = min(self._t_end, self.until)
            t = np.linspace(0, end, SAMPLES)
            values = self._arguments(t, 0)
            far = np.unique([values.argmin(axis=0), values.argmax(axis=0)])
            bad = [k for k in far if self._refused(values[k])]
            if not bad or end == 0:
                return values.min(axis=0), values.max(axis=0)
            good, wrong = 0.0, float(t[bad[0]])
            for _ in range(HALVINGS):
                middle = (good + wrong) / 2
                if self._refused(self._arguments(np.array([middle]), 0)[0]):
                    wrong = middle
                else:
                    good = middle
            self.reason = self._refused(self._arguments(np.array([wrong]), 0)[0])
            self.until = good
            if getattr(self._first, "lasts", False):
                raise TensegrityError(f"{self.reason}: it is driven there at t = {good:.6g} s")

    def _refused(self, arguments: Array) -> TensegrityError | None:
        """The error of the spring with these arguments, or None if it exists."""
        try:
            _ = self._spring(arguments).computable_domain
        except TensegrityError as error:
            return error
        return None

    def _fit(self, low: Array, high: Array) -> tuple[Any, Array, Array, Array]:
        """Law, series of its parameters and its domain, and centre and half-range of each
        argument."""
        width = high - low
        wider = WIDER * width + 1e-12 * np.abs(high)
        rooms = [wider, 0 * wider]  # the spring may not exist beyond the range of an argument
        for room in rooms:
            middle, half = (low + high) / 2, width / 2 + room
            half = np.where(half > 0, half, 1.0)
            moves = width > 1e-12 * np.maximum(np.abs(low), np.abs(high))
            try:
                return *self._fitted(middle, half, moves), middle, half
            except ResolutionError:
                raise
            except TensegrityError:
                if not room.any():
                    raise
        raise AssertionError

    def _fitted(self, middle: Array, half: Array, moves: Any) -> tuple[Any, Array]:
        worst = np.inf
        for size in SIZES:
            sizes = [size if one else 1 for one in moves]
            if np.prod(sizes) > MOST_NODES:
                break
            springs = {
                at: self._spring(middle + half * np.array([chebyshev.chebpts1(n)[k] for n, k in
                                                            zip(sizes, at, strict=True)]))
                for at in product(*map(range, sizes))
            }  # fmt: skip
            law, values = self._tabulated(list(springs.values()))
            series = values.reshape(*sizes, -1)
            for axis, n in enumerate(sizes):
                x = chebyshev.chebpts1(n)
                series = np.moveaxis(
                    np.tensordot(np.linalg.inv(chebyshev.chebvander(x, n - 1)), series, (1, axis)),
                    0, axis,
                )  # fmt: skip
            series = np.ascontiguousarray(series)
            flat = series.reshape(-1, series.shape[-1])  # a view
            flat[1:, np.abs(flat[1:]).max(axis=0, initial=0.0) <= CONSTANT * np.abs(flat[0])] = 0.0
            places = np.where(moves, TEST_POINTS[:, None], 0.0)
            tested = zip(places, _value(series, places)[:, :-2], strict=True)
            error = max(self._misfit(law, middle + half * x, p) for x, p in tested)
            if error <= GOOD:
                return law, series
            if error < worst:
                worst, best = error, (law, series)
        if worst <= MISFIT:
            return best
        raise ResolutionError(
            f"the spring changes too abruptly with {', '.join(self._signals)}: a series of {size} "
            f"nodes has a relative error of {worst:.2g} in the tension, must be at most {MISFIT:g}"
        )

    def _tabulated(self, springs: list[Potential]) -> tuple[Any, Array]:
        """The common law of some springs, and the parameters and ends of the domain of each."""
        laws = list(dict.fromkeys(spring.law for spring in springs))
        law: Any = laws[0]
        if len(laws) > 1:  # elastic prisms: some need more iterations than others
            law = max(laws, key=lambda one: getattr(one, "steps", 0))
        if len(laws) > 1 and not all(hasattr(one, "steps") for one in laws):
            raise TensegrityError("a spring over time must keep its law")
        shifts = np.array([one._shift_from(self._first) for one in springs])
        for spring, shift in zip(springs, shifts, strict=True):
            if spring.length != self._first.length and not shift:
                raise TensegrityError(
                    f"a spring has length {spring.length:.12g} m at rest, that of t = 0 "
                    f"{self._first.length:.12g} m: elongations would refer to another shape"
                )
        rows = np.array([spring.values for spring in springs])
        ends = np.array([spring.computable_domain for spring in springs]) - shifts[:, None]
        if shifts.any():
            law, rows = Shifted(law), np.column_stack([rows, shifts])
        return law, np.column_stack([rows, np.clip(ends, -NO_END, NO_END)])

    def _misfit(self, law: Any, arguments: Array, p: Array) -> float:
        """Largest error of the tension of parameters p between the nodes, over its largest
        value."""
        spring = self._spring(arguments)
        shift = spring._shift_from(self._first)
        places = [abs(x[0]) for x in spring.kinks if np.isfinite(x[0])]
        size = max(places, default=0.0) or 1.0
        reach = [
            end if np.isfinite(end) else np.copysign(size, end) for end in spring.computable_domain
        ]
        r = np.concatenate([reach[0] * FRACTIONS, reach[1] * FRACTIONS])
        right = spring.tension(r)
        wrong = np.abs(evaluated(law, 1, np.ascontiguousarray(p), r - shift) - right)
        if not np.any(right) and not np.any(wrong):
            return 0.0  # a string that is slack at all of these
        worst = float(np.max(wrong) / np.max(np.abs(right)))
        return worst if np.isfinite(worst) else np.inf

    def _values(self, t: Array) -> tuple[Array, Array]:
        """Parameters and ends of the domain, and their rates; (t.size, parameters + 2) each."""
        count = len(self._moves)
        values = np.tile(self.series.reshape(-1, count)[0], (len(t), 1))
        rates = np.zeros_like(values)
        if self._moves.any():
            x = np.clip((self._arguments(t, 0) - self._low) / self._half, -1.0, 1.0)
            parts = np.split(_value(self._all, x), 1 + x.shape[1], axis=1)
            values[:, self._moves] = parts[0]
            each = self._arguments(t, 1) / self._half
            rates[:, self._moves] = sum(one * each[:, [k]] for k, one in enumerate(parts[1:]))
        return values, rates

    def at(self, t: Array) -> Array:
        """Parameters of the law at times t [s]; (t.size, parameters)."""
        return self._values(t)[0][:, :-2]

    def domain(self, t: Array) -> Array:
        """Lowest and highest elongation [m] at times t [s]; (t.size, 2)."""
        return finite_ends(self._values(t)[0][:, -2:])

    def numbers(self, t: Array) -> tuple[Array, Array]:
        """Parameters at times t [s], followed by their rates per second, (t.size, 2 parameters),
        and `domain`."""
        values, rates = self._values(t)
        together = np.concatenate([values[:, :-2], rates[:, :-2]], axis=1)
        return together, finite_ends(values[:, -2:])

    def range_error(self, t: float, r: float) -> LockingError:
        """The error for an elongation r [m] at or beyond an end of the domain at time t [s]."""
        spring = self._given.at(t)
        return spring._range_error(r + spring._shift_from(self._first))


class TimedSprings:
    """The springs of a scene, of which some change with time, in the form of the compiled loop.

    Parameters
    ----------
    springs : Springs
    t_end : float
        End of the run [s].

    Attributes
    ----------
    series : list of Series
        One for each different spring, of whatever length its bonds are.
    number : ndarray of int, (springs,)
        The series of each of `springs`.
    group : ndarray of int, (bonds,)
        The series of each bond.
    laws : tuple of Change
    law : ndarray of int, (series,)
        Index into `laws`.
    columns : ndarray of int, (series, most parameters)
        Where `numbers` has the parameters of the law, and their rates; of those that are constant
        and equal, in one place.
    until, reason
        As of `Series`, of the first spring that ceases to exist.
    """

    def __init__(self, springs: Springs, t_end: float) -> None:
        place: dict[Potential, int] = {}
        number = [place.setdefault(spring, len(place)) for spring, _ in springs.kinds]
        self.number = np.array(number)
        self.group, self.series = self.number[springs.group], [Series(x, t_end) for x in place]
        moving: dict[Any, set[int]] = {}
        for one in self.series:
            moving.setdefault(one.law, set()).update(one.moving)
        self.laws = tuple(Change(law, tuple(sorted(those))) for law, those in moving.items())
        self.law = np.array([[*moving].index(one.law) for one in self.series])
        self._width = max(len(law.parameters) for law in self.laws)
        self.columns = self._columns()
        ending = min(self.series, key=lambda one: one.until)
        self.until, self.reason = ending.until, ending.reason

    def _columns(self) -> Indices:
        row, known = self.numbers(np.zeros(1))[0].reshape(len(self.series), -1), dict[Any, int]()
        columns = np.arange(row.size).reshape(row.shape)
        for k, one in enumerate(self.series):
            count = len(one.law.parameters)
            for j, value in enumerate(row[k].tolist()):
                if j >= 2 * count or j % count not in one.moving:
                    columns[k, j] = known.setdefault(value, columns[k, j])
        return columns

    def numbers(self, t: Array) -> tuple[Array, Array]:
        """Numbers of all series at times t [s], (t.size, numbers), and the ends of their domains
        [m], (t.size, 2 series)."""
        rows = np.zeros((len(t), len(self.series), self._width))
        ends = np.zeros((len(t), len(self.series), 2))
        for k, one in enumerate(self.series):
            numbers, ends[:, k] = one.numbers(t)
            rows[:, k, : numbers.shape[1]] = numbers
        return rows.reshape(len(t), -1), ends.reshape(len(t), -1)

    def energies(self, t: Array, r: Array) -> Array:
        """Energies at elongations r (t.size, bonds) [m], each row at an instant; of its shape."""
        out = np.empty_like(r)
        for k, one in enumerate(self.series):
            bonds, loop = self.group == k, loop_of_law(one.law)
            mine, energies = np.ascontiguousarray(r[:, bonds]), np.empty((len(t), bonds.sum()))
            for p, row, to in zip(np.ascontiguousarray(one.at(t)), mine, energies, strict=True):
                loop.evaluator.values(0, len(row), *(x.ctypes.data for x in (p, row, to)))
            out[:, bonds] = energies
        return out


def _with_rates(series: Array) -> Array:
    """A tensor series, followed along the last axis by its derivatives in each argument."""
    rows = [series]
    for axis in range(series.ndim - 1):
        rate = np.zeros_like(series)
        if series.shape[axis] > 1:
            shorter = chebyshev.chebder(series, axis=axis)
            np.moveaxis(rate, axis, 0)[:-1] = np.moveaxis(shorter, axis, 0)
        rows.append(rate)
    return np.concatenate(rows, axis=-1)


def _value(series: Any, x: Any) -> Any:
    """Tensor Chebyshev series (*sizes, columns) at points (points, arguments)."""
    value = chebyshev.chebvander(x[:, 0], len(series) - 1) @ series.reshape(len(series), -1)
    value = value.reshape(len(x), *series.shape[1:])
    for k in range(1, x.shape[1]):
        basis = chebyshev.chebvander(x[:, k], value.shape[1] - 1)
        value = np.einsum("pn,pn...->p...", basis, value)
    return value
