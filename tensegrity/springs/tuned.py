"""Springs that change with time, in the form of the compiled loop.

If the arguments of a spring are functions of time, the parameters of its law are represented by
Chebyshev series in the arguments, over the range of these in a run; the series stay short however
fast the change is, and the rates follow by the chain rule.  If the spring itself is a function of
time, the series are in time.  A prism, and a contact under a preload, is measured from an
equilibrium that depends on the arguments: elongations refer to that at t = 0, and the law is
shifted accordingly.  The series are verified against the springs between their nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from tensegrity import check
from tensegrity.engine.compiled import evaluated, loop_of_law
from tensegrity.engine.law import Law
from tensegrity.errors import LockingError, ResolutionError, TensegrityError
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

SIZES = (5, 9, 17, 33, 65)  # nodes of the series in each argument
LONG = (*SIZES, 129, 257, 513)  # nodes of the series in time
PER_NODE = 4  # times per node at which a series in time is compared with the springs
TEST_POINTS = np.array([-0.99, -0.437, 0.211, 0.683, 0.97])  # the same for series in arguments
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


class Tuned:
    """A spring that changes with time.

    Parameters
    ----------
    spring : Potential
        The spring at t = 0.
    tune : callable t -> Potential, or dict of str to callable (t, order) -> ndarray
        The spring as a function of time, or its arguments as functions of time.
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

    def __init__(self, spring: Potential, tune: Any, t_end: float) -> None:
        self._given, self._tune, self._t_end = spring, tune, t_end
        self._signals = {"time": _clock} if callable(tune) else dict(tune)
        self._first = self._spring(self._arguments(np.array([0.0]), 0)[0])
        box = self._argument_ranges()
        self.law, self.series, self._low, self._half = self._fit(*box)
        flat = np.abs(self.series.reshape(-1, self.series.shape[-1]))
        self._moves = flat[1:].max(axis=0, initial=0.0) > 0  # the other series are constant
        self._all = _with_rates(self.series[..., self._moves])

    @property
    def moving(self) -> tuple[int, ...]:
        """Indices of the parameters that change."""
        return tuple(np.flatnonzero(self._moves[:-2]).tolist())

    def energies(self, t: Array, r: Array) -> Array:
        """Energies at elongations r (t.size, bonds) [m], each row at an instant; of its shape."""
        loop, r = loop_of_law(self.law), np.ascontiguousarray(r)
        out, parameters = np.empty_like(r), np.ascontiguousarray(self.at(t))
        for p, row, energies in zip(parameters, r, out, strict=True):
            loop.evaluator.values(0, r.shape[-1], *(x.ctypes.data for x in (p, row, energies)))
        return out

    def evaluate(self, order: int, p: Array, r: Array) -> Array:
        """A derivative of the energy.

        Parameters
        ----------
        order : int
            1 for the tension [N], 2 for the stiffness [N/m].
        p : ndarray, (parameters, n)
            Parameters of the law at each elongation.
        r : ndarray, (n,)
            Elongations [m].

        Returns
        -------
        ndarray, (n,)
        """
        return evaluated(self.law, order, p, r)

    def _arguments(self, t: Array, order: int) -> Array:
        """Arguments at times t, or their rates for order 1; (t.size, arguments)."""
        return np.stack([np.asarray(f(t, order)) for f in self._signals.values()], axis=-1)

    def _spring(self, arguments: Array) -> Potential:
        if callable(self._tune):
            t = float(arguments[0])
            return spring_at(self._tune, min(max(t, 0.0), self._t_end))
        return self._given.varied(dict(zip(self._signals, arguments.tolist(), strict=True)))

    def _argument_ranges(self) -> tuple[Array, Array]:
        """Lowest and highest arguments, up to the time at which the spring ceases to exist."""
        if callable(self._tune):
            return np.zeros(1), np.full(1, self._t_end)
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
        for room in rooms[1:] if callable(self._tune) else rooms:
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
        for size in LONG if callable(self._tune) else SIZES:
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
            error = max(
                self._misfit(law, series, middle, half, np.where(moves, place, 0.0))
                for place in self._test_points(size)
            )
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
            raise TensegrityError("the springs of a function of time must all have the same law")
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

    def _test_points(self, size: int) -> Array:
        """Points in [-1, 1] at which a series of `size` nodes is compared with the springs."""
        if not callable(self._tune):
            return TEST_POINTS
        count = PER_NODE * size
        return 2 * (np.arange(count) + 0.5) / count - 1

    def _misfit(self, law: Any, series: Array, middle: Array, half: Array, x: Array) -> float:
        """Largest error of the tension at arguments x between the nodes, over its largest value."""
        spring = self._spring(middle + half * x)
        p = np.ascontiguousarray(_value(series, x[None])[0, :-2])
        shift = spring._shift_from(self._first)
        places = [abs(x[0]) for x in spring.kinks if np.isfinite(x[0])]
        size = max(places, default=0.0) or 1.0
        reach = [
            end if np.isfinite(end) else np.copysign(size, end) for end in spring.computable_domain
        ]
        r = np.concatenate([reach[0] * FRACTIONS, reach[1] * FRACTIONS])
        right = spring.tension(r)
        wrong = np.abs(evaluated(law, 1, p, np.ascontiguousarray(r - shift)) - right)
        worst = float(np.max(wrong) / np.max(np.abs(right)))
        return worst if np.isfinite(worst) else np.inf

    def _values(self, t: Array) -> tuple[Array, Array]:
        """Parameters and ends of the domain, and their rates; (t.size, parameters + 2) each."""
        x = np.clip((self._arguments(t, 0) - self._low) / self._half, -1.0, 1.0)
        parts = np.split(_value(self._all, x), 1 + x.shape[1], axis=1)
        count = len(self._moves)
        values = np.tile(self.series.reshape(-1, count)[0], (len(t), 1))
        rates = np.zeros_like(values)
        values[:, self._moves] = parts[0]
        each = self._arguments(t, 1) / self._half
        rates[:, self._moves] = sum(one * each[:, [k]] for k, one in enumerate(parts[1:]))
        return values, rates

    def at(self, t: Array) -> Array:
        """Parameters of the law at times t [s]; (t.size, parameters)."""
        return self._values(t)[0][:, :-2]

    def rates(self, t: Array) -> Array:
        """Rates of the parameters at times t [s], per second; (t.size, parameters)."""
        return self._values(t)[1][:, :-2]

    def domain(self, t: Array) -> Array:
        """Lowest and highest elongation [m] at times t [s]; (t.size, 2)."""
        return finite_ends(self._values(t)[0][:, -2:])

    def numbers(self, t: Array) -> tuple[Array, Array]:
        """Arrays of the compiled loop at times t [s]: parameters followed by their rates,
        (t.size, 2 parameters), and `domain`."""
        values, rates = self._values(t)
        together = np.concatenate([values[:, :-2], rates[:, :-2]], axis=1)
        return together, finite_ends(values[:, -2:])

    def spring(self, t: float) -> Potential:
        """The spring at time t [s], measured from its own equilibrium."""
        return self._spring(self._arguments(np.array([t]), 0)[0])

    def range_error(self, t: float, r: float) -> LockingError:
        """The error for an elongation r [m] at or beyond an end of the domain at time t [s]."""
        spring = self.spring(t)
        return spring._range_error(r + spring._shift_from(self._first))


def spring_at(tune: Callable[[float], Potential], t: float) -> Potential:
    """The spring that a function of time returns at time t [s]."""
    spring = tune(t)
    check.kind(f"tune({t:g})", spring, Potential)
    return spring


def _clock(t: Array, order: int) -> Array:
    """Time as an argument, and its rate for order 1."""
    return np.ones(t.shape) if order else t


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
