"""Potentials of one coordinate whose other coordinates are in equilibrium.

Newton's method eliminates the inner unknowns at given elongation.  It starts from a traced path or,
in the compiled loop, from polynomials of the elongation, and takes a fixed number of iterations
there, so that the law has neither state nor branches.  Derivatives by parameters are those at
constant unknowns, corrected by the change of the unknowns (envelope theorem); the iterations are
not differentiated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.law import deflated
from tensegrity.errors import EquilibriumError, LockingError, RangeError
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.unit.law import GUESS, SCALES, CondensedLaw, compiled_functions, condensed

STALLED = 1e-10  # size below which a step that no longer shrinks is round-off
ITERATIONS = 20
STEPS = (1, 2, 4)  # admissible numbers of its iterations
SETTLED = 1e-14  # largest change by a further iteration, over the largest unknown
SAMPLES = 512  # elongations at which this is checked
HALVINGS = 8  # bisections of the fraction of the domain


REACHED = "the requested load is reached"
SETTINGS = Settings(tolerance=1e-7, largest=0.2)


class CondensedPotential(Potential):
    """Potential of the last unknown of some equations, the others of which hold.

    Subclasses have the law of the compiled loop (`_law`), words for the ends of their paths
    (`_reason`, `_beyond`), and derivatives by their arguments (`_rates_by`).
    """

    _described: str  # what it is made of, in messages
    _given = "elongation"  # what is given where a path is followed, in messages
    _base = _stiffness = 1.0  # units of the equations: length [m], energy over its square [N/m]
    _size: float  # length whose round-off the ends of the domain have [m]
    _preload: float
    _problem: Any  # whose path is followed
    _p: Any  # its parameters
    _scale: Array  # of the unknowns, (m,)
    _at_rest: Array  # unknowns at rest, (m,)
    _rise: Array  # values of the last unknown along the path, (rows,)
    _nodes: Array  # asinh of the unknowns over their scale there, (rows, m)
    _rates: Array  # their derivatives by the last, (rows, m - 1)

    def _law(self, steps: int) -> CondensedLaw:
        raise NotImplementedError

    def _reason(self, end: str) -> str:
        """Why the domain ends at an event or value of a column."""
        raise NotImplementedError

    def _beyond(self, path: Any) -> str:
        """That a path ends before the preload is reached."""
        raise NotImplementedError

    def _rates_by(self, name: str) -> tuple[Sequence[float], Array]:
        """Derivatives of 1/base, force and preload, and of the parameters, by an argument."""
        raise NotImplementedError

    def _function(self, name: str) -> Any:
        return partial(compiled_functions(self._law(0)), name)

    def _follow(
        self,
        down: Sequence[str],
        up: Sequence[str],
        lowest: Mapping[str, float],
        highest: Mapping[str, float],
    ) -> None:
        """Follow the path from the state without load in both senses, to events `down` and `up` or
        to values of columns, and find the state at rest."""
        self._at_rest = start = np.zeros(len(self._scale))
        if self._preload:
            stop = "fold", *(x for x in down if x != "turn")
            sense, bound = (-1, lowest) if self._preload > 0 else (1, highest)
            until = {"load": self._preload, **bound}
            path: Any = trace(self._problem, start, self._p, SETTINGS, sense, stop, until=until)
            if path.end != REACHED:
                raise EquilibriumError(f"preload {self._preload:g} N {self._beyond(path)}")
            self._at_rest = np.asarray(path.z[-1])
        sides = []
        for sense, stop, until in ((-1, down, lowest), (1, up, highest)):
            path = trace(
                self._problem, start, self._p, SETTINGS, sense, stop, until=until or None
            )  # fmt: skip
            lost = [e.row for e in path.events if e.kind == "bifurcation"]
            end = "bifurcation" if lost else path.end
            sides.append((path[: lost[0] + 1] if lost else path, self._ended(end)))
        (low, below), (high, above) = sides
        self.ends = below, above
        z = np.concatenate([low.z[:0:-1], high.z])
        tangents = np.concatenate([-low.tangent[:0:-1], high.tangent])
        self._rise, self._nodes = z[:, -1], np.arcsinh(z / self._scale)
        moved = tangents[:, -1:] * np.hypot(z[:, -1:], self._scale[-1])
        self._rates = tangents[:, :-1] / moved

    def _ended(self, end: str) -> str:
        known = {"bifurcation": "becomes unstable", "turn": "is lost"}
        words = known.get(end)
        return f"equilibrium at given {self._given} {words}" if words else self._reason(end)

    def _measure(self, start: float) -> None:
        """Length and domain, of the last coordinate without load [m]."""
        rise, base = self._at_rest[-1], self._base
        length = float(start + rise * base)
        self._length = length if length > 0 else None
        self._size = max(abs(start), abs(length), base * float(np.abs(self._rise).max()))
        low, high = (float(x - rise) * base for x in self._rise[[0, -1]])
        self._domain = low, high

    def slopes(self, name: str) -> Array:
        """Derivatives of the values of the law's parameters by an argument, at constant preload.

        Parameters
        ----------
        name : str

        Returns
        -------
        ndarray, (parameters of the law,)
            0 for what only the guess of the unknowns depends on.
        """
        (by_base, by_force, by_preload), by_p = self._rates_by(name)
        _, (_, value, stiffness, _), by = condensed(self._law(0))
        at = self._at_rest, self._p
        tension, stiff = (float(f(*at)) for f in (value, stiffness))
        energy, change = (float(np.array(x).ravel() @ by_p) for x in by(*at))
        force = self._stiffness * self._base
        moved = (by_preload + by_force * tension) / force + change
        rise = -moved / stiff if moved else 0.0
        found = np.zeros(len(self.values))
        found[: len(SCALES)] = by_base, by_force, by_preload, rise, energy + tension * rise
        found[len(SCALES) : len(SCALES) + len(by_p)] = by_p
        return found

    @property
    def law(self) -> Any:
        """The law of the compiled loop."""
        if self._in_loop[0] is None:
            raise EquilibriumError(
                f"the compiled loop finds no equilibria of {self._described} about its length "
                f"{self._length:g} m under the preload: its members are too stiff or too soft"
            )
        return self._in_loop[0]

    @property
    def values(self) -> Array:
        """Values of its parameters."""
        return self._in_loop[1]

    @property
    def computable_domain(self) -> tuple[float, float]:
        """Range of elongations that the compiled loop can follow [m].

        It is the whole `domain`, with two exceptions.  For members so stiff that the bars of the
        rigid prism would meet far inside the domain, it ends shortly before that contact; for
        members so soft that they take most of the extension, it ends within the extension.
        """
        return self._in_loop[2]

    @cached_property
    def _in_loop(self) -> Any:
        """Law, parameters and range: the widest range on which the iterations converge."""
        whole = self._compiled_on(*self._domain)
        return whole or self._part() or (None, np.empty(0), (math.inf, -math.inf))

    def _part(self) -> Any:
        """Law, parameters and range where they do not converge on all of it; None if nowhere."""
        low, high = self._domain
        below = self._widest(lambda part: (low * part, high))
        return below or self._widest(lambda part: (low, high * part))

    def _widest(self, ends: Any) -> Any:
        """The result of `_compiled_on` on the largest part of the domain where there is one."""
        widest, good, bad = None, 0.0, 1.0
        for _ in range(HALVINGS):
            part = (good + bad) / 2
            shorter = self._compiled_on(*ends(part))
            widest, good, bad = (shorter, part, bad) if shorter else (widest, good, part)
        return widest

    def _compiled_on(self, low: float, high: float) -> Any:
        """Law, parameters and range for elongations in an interval; None if the iterations do not
        converge on it."""
        values = self._values_on(low, high, self._fitted(low, high))
        step, guess, taken = self._function("step"), self._function("guess"), 0
        z = guess(np.linspace(low, high, SAMPLES)[:, None], values)
        for steps in STEPS:
            for _ in range(taken, steps):
                z = step(z, self._p)
            taken, moved = steps, np.abs(step(z, self._p) - z)
            if (moved.max(axis=0) <= SETTLED * np.abs(z).max(axis=0)).all():
                return self._law(steps), values, (low, high)
        return None

    def _fitted(self, low: float, high: float) -> Array:
        """Coefficients of the initial unknowns: their values at rest, which are exact, and the
        polynomial in t = (r - middle)/half of their mean slope from there."""
        from numpy.polynomial import chebyshev

        t = chebyshev.chebpts1(2 * GUESS)
        middle, half = (low + high) / 2, (high - low) / 2
        z = self.states(middle + half * t)[:, :-1]
        fits = [chebyshev.cheb2poly(c) for c in chebyshev.chebfit(t, z, GUESS).T]
        slopes = np.array([deflated(fit, -middle / half) for fit in fits]) / half
        return np.column_stack([self._at_rest[:-1], slopes])

    def _values_on(self, low: float, high: float, coefficients: Array) -> Array:
        (energy_at_rest,) = self._function("value_0")(self._at_rest, self._p)
        per_base, force = 1 / self._base, self._stiffness * self._base
        scales = per_base, force, self._preload, self._at_rest[-1], energy_at_rest
        interval = (low + high) / 2, 2 / (high - low)
        return np.array([*scales, *self._p, *interval, *coefficients.ravel()])

    def _range_error(self, r: float) -> LockingError:
        """The error for an elongation at or beyond an end of either domain."""
        if not self._domain[0] < r < self._domain[1]:
            return super()._range_error(r)
        side = int(r > 0)
        way, what = (
            ("below", "stiff; take them as rigid (inf)"),
            ("above", "stiff, or this soft"),
        )[side]
        return RangeError(
            f"elongation {r:.6g} m is at or {way} {self.computable_domain[side]:.6g} m, as far as "
            f"the compiled loop can follow members this {what}"
        )

    def states(self, r: Array) -> Array:
        """Unknowns of the equilibria at elongations r (r.size,) [m], (r.size, m)."""
        rise = self._at_rest[-1] + np.clip(r, *self._domain) / self._base
        rise = np.clip(rise, self._rise[0], self._rise[-1])
        z = self._guess(rise)
        step, previous = self._function("step"), math.inf
        for _ in range(ITERATIONS):
            new = step(z, self._p)
            moved = np.max(np.abs(new - z) / (1 + np.abs(z)), initial=0.0)
            z = new
            if moved <= 1e-15 or (moved <= STALLED and moved >= previous / 4):
                return z
            previous = moved
        raise EquilibriumError(
            f"no equilibrium found at heights {(self._length or 0.0) + np.min(r):g} to "
            f"{(self._length or 0.0) + np.max(r):g} m: the last iteration moved {moved:.3g}"
        )

    def _guess(self, rise: Array) -> Array:
        """Cubic interpolation of the traced branch."""
        at = np.clip(np.searchsorted(self._rise, rise, side="right"), 1, len(self._rise) - 1)
        length = self._rise[at] - self._rise[at - 1]
        u = ((rise - self._rise[at - 1]) / length)[:, None]
        w, length = 1 - u, length[:, None]
        z = self._nodes[:, :-1]
        z = w * w * (1 + 2 * u) * z[at - 1] + u * u * (1 + 2 * w) * z[at]
        z = z + length * u * w * (w * self._rates[at - 1] - u * self._rates[at])
        return np.column_stack([np.sinh(z) * self._scale[:-1], rise])

    def derivative(self, order: int, r: ArrayLike, closed: bool = False) -> Array:
        """Derivative of the energy in the elongation.

        Parameters
        ----------
        order : int
            0 for the energy, up to 3.
        r : array_like, any shape
            Elongation [m]; extension > 0.
        closed : bool, optional
            Without effect: the ends of the domain are included in any case.

        Returns
        -------
        ndarray, shape of r
            [N m^(1 - order)].

        Raises
        ------
        LockingError
            If an elongation is outside the domain.
        """
        r = check.numbers("elongation", r, "m")
        low, high = self._domain
        # the ends are computed roots: allow for their round-off, large at small prestrain
        slack = 64 * np.finfo(float).eps * self._size
        inside = (r >= low - slack) & (r <= high + slack)
        if not inside.all():
            raise super()._range_error(float(r[~inside].flat[0]))
        if r.size == 0:
            return np.empty(r.shape)
        flat = np.ascontiguousarray(r).reshape(-1)
        if (
            order == 0
            and self.computable_domain[0] <= flat.min()
            and flat.max() <= self.computable_domain[1]
        ):
            return evaluated(self.law, 0, self.values, flat).reshape(r.shape)
        return self._from_states(order, flat).reshape(r.shape)

    def _from_states(self, order: int, r: Array) -> Any:
        """The order-th derivative of the energy at elongations r (r.size,), (r.size,)."""
        value = self._function(f"value_{order}")
        result = value(self.states(r), self._p)[:, 0]
        result = result * self._stiffness * self._base ** (2 - order)
        if order == 0:
            (rest,) = value(self._at_rest, self._p)
            result = result - rest * self._stiffness * self._base**2 + self._preload * r
        return result + self._preload if order == 1 else result
