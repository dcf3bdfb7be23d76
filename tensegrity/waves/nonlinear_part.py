"""The nonlinear part of a spring's force, without cancellation.

Waves slightly above the sound speed depend on V'(r) - V''(0) r, which computed as a difference is
round-off.  Near rest it is r^2 times a mean of V''' over (0, r), and the nonlinear parts of
stiffness and energy are similar means: V''' is fitted by a polynomial, over the largest range on
which one fits to round-off, and integrated.  Beyond that range the difference is used.  V(0) is
subtracted, since the zero of the energy is arbitrary.

It also determines the families of waves of one sign.  A front between rest and a state r can
propagate at one speed only, m c^2 = V'(r)/r = Q(r) with Q = 2 V/r^2, and only where Q' = 0; see
`derivations.softening`.  Hence there is one family for each part on which Q, going out from rest,
rises above all its previous values: within the family m c^2 lies between the value from which Q
rises, that of rest or of the preceding front, and the value that it attains.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev, legendre

from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.springs.potential import Potential

DEGREE = 25  # of the polynomial; odd, so that rest is not a node
FITTED = 1e-14  # size of the last coefficients over the largest
HALVINGS = 40  # of the range on which a polynomial is sought
CHANGE = 0.5  # relative change of V'' that defines the scale of a potential
AT_REST = 1e-9  # V'(0) over V''(0) times the scale that is round-off
ROUND_OFF = 1e-10  # derivative at rest, over the largest nonlinear force, that is round-off
CLOSER = 16  # halvings of the range in which the power of the force near rest is determined
BINADES = 1000  # factors of 2 that are searched for the scale
FLAT = 1e-9  # rise of Q over V''(0) + Q that is round-off
ROUGH = 1e-6  # the same without a polynomial near rest
NEAR = 1e-3  # size over the scale of such a spring from which on Q is evaluated
NODES = chebyshev.chebpts1(DEGREE + 1)
TO_SERIES = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))


class NonlinearPart:
    """A potential V as V(0) + V''(0) r^2/2 plus its nonlinear part.

    Attributes
    ----------
    rest : float
        V''(0) [N/m].
    scale : float
        Size of the elongation, within a factor of 2, at which V'' has changed by half of V''(0)
        [m]; inf if V'' does not change or is 0 at rest.
    core : float
        Size of the elongation up to which the polynomial is used [m]; may be 0.
    slope, bend, fifth, sixth : float
        V'''(0) [N/m^2], V''''(0) [N/m^3] and the next derivatives of the polynomial, 0 if they
        are round-off; nan without a polynomial.

    Raises
    ------
    TensegrityError
        The spring is not in equilibrium at r = 0.
    """

    def __init__(self, potential: Potential):
        self.potential = potential
        self.rest = float(potential.stiffness(0.0))
        self._energy = float(potential.energy(0.0))
        self._tension = float(potential.tension(0.0))
        self.scale = self._scale()
        if abs(self._tension) > AT_REST * abs(self.rest) * self.scale:
            raise TensegrityError(
                f"tension {self._tension:g} N at r = 0 must be 0: the spring is not at rest there"
            )
        self.core, self._means = self._fit()
        self.slope, self.bend, self.fifth, self.sixth = self._derivatives()
        self._zeros = 0  # order of the zero of V''' at rest, factored out of the polynomial
        self._take_zeros_out()

    def _scale(self):
        if self.rest <= 0:
            return math.inf
        return min(self._scale_on(side) for side in (-1, 1))

    def _scale_on(self, side):
        end = abs(self.potential.domain[side > 0])
        top = 2.0**BINADES if math.isinf(end) else end / 2
        sizes = top * 2.0 ** -np.arange(2 * BINADES if math.isinf(end) else BINADES)[::-1]
        with np.errstate(all="ignore"):
            change = np.abs(self.potential.derivative(2, side * sizes) / self.rest - 1)
        change = np.where(np.isnan(change), math.inf, change)
        far = np.flatnonzero(change >= min(CHANGE, change.max() / 2))
        return float(sizes[far[0]]) if change.max() > AT_REST else math.inf

    def _fit(self):
        """Range of the polynomial, and the series of the means of V''' on it."""
        if math.isinf(self.scale):
            return 0.0, None
        for halvings in range(HALVINGS):
            core = self.scale / 2.0**halvings
            if core >= min(map(abs, self.potential.domain)):
                continue
            with np.errstate(all="ignore"):
                means = self._fitted(core)
                if means is None:
                    continue
                direct = self.potential.derivative(2, core * NODES) - self.rest
            series = chebyshev.chebval(NODES, means[:, 0]) * core * NODES
            if np.max(np.abs(series - direct)) <= AT_REST * self.rest:  # else V'' jumps
                return core, means
        return 0.0, None

    def _fitted(self, core, zeros=0):
        """Series of the means of V''' if it is a polynomial times r^zeros on a range, else None."""
        slope = TO_SERIES @ (self.potential.derivative(3, core * NODES) / NODES**zeros)
        if not np.max(np.abs(slope[-3:])) <= FITTED * np.max(np.abs(slope)):
            return None
        return TO_SERIES @ _means(slope, NODES, zeros)

    def _take_zeros_out(self):
        """Divide V''' = O(r^k) by r^k, since otherwise its round-off dominates near rest."""
        power, other = self.growth(1)[0], self.growth(-1)[0]
        if not self.core or power != other or not power.is_integer() or power == 2:
            return
        means = self._fitted(self.core, int(power) - 2)
        if means is not None:
            self._zeros, self._means = int(power) - 2, means

    def _derivatives(self):
        if self._means is None:  # V''' jumps or overflows
            return (math.nan,) * 4
        series = self._means[:, 1]  # of V' - V''(0) r over r^2
        values = (
            (k + 1) * (k + 2) * chebyshev.chebval(0.0, chebyshev.chebder(series, k))
            for k in range(4)
        )
        largest = np.max(np.abs(series))
        return tuple(
            float(x) / self.core**k if abs(x) > ROUND_OFF * largest else 0.0
            for k, x in enumerate(values)
        )

    def growth(self, side):
        """p and d [N/m^p] of V' = V''(0) r + side d |r|^p near rest on one side; NaN if the
        nonlinear force is not a power there."""
        if self.core and (self.slope or self.bend):
            return (2.0, side * self.slope / 2) if self.slope else (3.0, self.bend / 6)
        if math.isinf(self.scale):
            return math.nan, math.nan
        sizes = (self.core or self.scale) / 2.0 ** np.arange(CLOSER)
        with np.errstate(all="ignore"):
            if self.core:
                gain = side * self.potential.derivative(3, side * sizes) * sizes
            else:
                gain = self.potential.derivative(2, side * sizes) - self.rest
                gain[np.abs(gain) < ROUND_OFF * self.rest] = math.nan
            powers = np.round(np.log2(gain[:-1] / gain[1:]), 2)  # NaN of other signs
        same = np.flatnonzero(powers[:-1] == powers[1:])
        if not same.size:
            return math.nan, math.nan
        k = int(same[-1])
        p = float(powers[k]) + 1
        return p, float(gain[k] / (p * (p - 1 if self.core else 1)) / sizes[k] ** (p - 1))

    def stiffness(self, r):
        """V'' - V''(0) [N/m] at elongations r [m] of any shape."""
        return self._beyond(0, r, lambda r: self.potential.derivative(2, r) - self.rest)

    def tension(self, r):
        """V' - V''(0) r [N] at elongations r [m] of any shape."""
        return self._beyond(
            1, r, lambda r: self.potential.derivative(1, r) - self._tension - self.rest * r
        )

    def energy(self, r):
        """V - V(0) - V''(0) r^2/2 [J] at elongations r [m] of any shape."""

        def direct(r):
            loaded = self._energy + self._tension * r
            return self.potential.derivative(0, r, closed=True) - loaded - self.rest * r * r / 2

        return self._beyond(2, r, direct)

    def _beyond(self, order, r, direct):
        r = np.asarray(r, dtype=float)
        if self._means is None:
            return direct(r)
        near = np.abs(r) <= self.core
        inside = np.where(near, r, 0.0)
        value = chebyshev.chebval(inside / self.core, self._means[:, order])
        value = value * (inside / self.core) ** self._zeros
        for _ in range(order + 1):
            value = value * inside
        value = np.array(value)
        if not near.all():
            value[~near] = direct(r[~near])
        return value


def _means(slope, x, zeros=0):
    """Means of the series `slope` from 0 to x with weights 1, 1 - t and (1 - t)^2/2, all times
    t^zeros; (n, 3)."""
    t, weight = legendre.leggauss(DEGREE // 2 + 2 + zeros)
    t = (1 + t) / 2
    weight = weight / 2 * t**zeros
    weights = np.array([weight, weight * (1 - t), weight * (1 - t) ** 2 / 2])
    return chebyshev.chebval(np.outer(x, t), slope) @ weights.T


@lru_cache(maxsize=256)
def nonlinear_part(potential: Potential) -> NonlinearPart:
    """The nonlinear part of a potential, cached."""
    return NonlinearPart(potential)


class RisingPart(NamedTuple):
    """A part on which Q rises above its previous values.

    Attributes
    ----------
    start : float
        Size of the elongation beyond which Q exceeds `floor` [m]; 0 at rest.
    floor : float
        Largest Q - V''(0) nearer to rest [N/m]; 0 at rest.
    top : float
        Size at which Q is largest [m]: a front; inf if Q rises to the end of the domain.
    ceiling : float
        Q - V''(0) there [N/m]; inf with `top`.
    """

    start: float
    floor: float
    top: float
    ceiling: float

    def bound(self, name):
        """Upper bound of a target of `by_target` ("amplitude", "above", "energy") in this part."""
        return {"amplitude": self.top, "above": self.ceiling, "energy": math.inf}[name]


def rising_parts(nonlinear, sign, sizes) -> list[RisingPart]:
    """All parts on which Q rises above its previous values.

    Parameters
    ----------
    nonlinear : NonlinearPart
    sign : {-1, 1}
        Sign of the elongation.
    sizes : ndarray, (n,)
        Increasing sizes of the elongation, from near rest [m], at which Q is sampled.

    Returns
    -------
    list of RisingPart
        Going out from rest.
    """

    def level_at(size):  # Q - V''(0)
        return 2 * nonlinear.energy(sign * size) / size / size

    def slope(size):  # r^3 Q'/2
        r = sign * size
        return float(r * nonlinear.tension(r) - 2 * nonlinear.energy(r))

    def crossing(low, high, floor):
        if level_at(low) >= floor:
            return float(low)
        return root(lambda size: float(level_at(size)) - floor, low, high, relative=1e-14)

    flat = FLAT
    if nonlinear.core == 0 < nonlinear.rest:  # differences of energies: round-off near rest
        sizes, flat = sizes[sizes > NEAR * nonlinear.scale], ROUGH
    level = level_at(sizes)
    unit = nonlinear.rest + np.abs(level)
    parts: list[RisingPart] = []
    floor, place = 0.0, 0
    if nonlinear.rest == 0 and level[1] - level[0] <= flat * unit[0]:  # not steeper than linear
        floor = float(level[0])
    while place < len(sizes):
        above = np.flatnonzero(level[place:] - floor > flat * unit[place:])
        if not above.size:
            break
        if place == floor == 0 and grows_from_rest(nonlinear, sign):
            above[0] = 0
        first = place + int(above[0])
        start = crossing(sizes[first - 1], sizes[first], floor) if first else 0.0
        highest = np.maximum.accumulate(level[first:])
        falls = np.flatnonzero(highest - level[first:] > flat * unit[first:])
        if not falls.size:
            parts.append(RisingPart(start, floor, math.inf, math.inf))
            break
        last = first + int(np.argmax(level[first : first + falls[0]]))
        ends = sizes[max(last - 1, 0) : last + 2]
        top = root(slope, ends[0], ends[-1], relative=1e-14)
        ceiling = float(nonlinear.tension(sign * top)) / (sign * top)
        parts.append(RisingPart(start, floor, top, ceiling))
        floor, place = max(floor, ceiling), first + int(falls[0])
    return parts


def grows_from_rest(nonlinear, sign) -> bool:
    """Whether waves of one sign start from zero amplitude: whether the leading nonlinear term of V'
    stiffens the spring."""
    return nonlinear.rest == 0 or nonlinear.growth(sign)[1] > 0
