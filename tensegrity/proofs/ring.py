"""Existence of a travelling wave on a ring near an approximate one, by Newton-Kantorovich bounds.

A wave of elongations r(x - c t) on a ring of P sites satisfies F(r) = r - mu * V'(r) = 0, where mu
multiplies mode n by (sin(k/2)/(k/2))^2/(m c^2) with k = 2 pi n/P.  Even series whose coefficients
have a finite sum of magnitudes form an algebra, whose norm bounds the largest elongation.  With an
approximate wave rbar and A near the inverse of DF(rbar), of a finite matrix and the identity beyond
it, let

    |A F(rbar)| <= Y,  |1 - A DF(rbar)| <= Z1,  |A| |mu| sup |V'''| <= Z2.

If Y + Z1 x + Z2 x^2/2 < x and Z1 + Z2 x < 1, then r - A F(r) contracts the ball of radius x about
rbar: it contains one wave.  V' is its Taylor polynomial, and Cauchy's bound of the rest.
Sources: J.-P. Lessard, J. D. Mireles James, J. Differ. Equ. 263 (2017) (radii polynomials); G.
Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (the equation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.proofs.balls import BallSpring, flint, precision
from tensegrity.typing import Array

SETTLED = 1e-32  # norm of the next coefficients, relative to the wave, that are neglected
MOST = 1500  # Taylor coefficients
NEWTON = 3  # steps by which the approximate wave is made more exact
ROUGH = 64  # bits of the bound Z1, of which a few digits are wanted
REACH = (0.9, 0.7, 0.5, 0.3, 0.15)  # parts of the way to the end of the domain: radii of discs


@dataclass(frozen=True)
class Even:
    """An even Fourier series c_0 + 2 sum c_n cos(k_n x), and a bound on the norm of what is left
    out."""

    modes: Any  # arb_poly of c_n
    rest: Any

    @property
    def norm(self) -> Any:
        """|c_0| + 2 sum |c_n|, at least the largest magnitude."""
        return sizes_from(self.modes.coeffs())[0] + self.rest

    def listed(self, count: int) -> list[Any]:
        """The first coefficients."""
        found = self.modes.coeffs()[:count]
        return [*found, *[flint().arb(0)] * (count - len(found))]

    def times(self, other: Even, count: int) -> Even:
        """The product, of at most so many modes.

        Parameters
        ----------
        other : Even
        count : int

        Returns
        -------
        Even
        """
        of, middle, both = flint().arb_poly, 0, []
        for x in (self.modes.coeffs(), other.modes.coeffs()):
            both.append(of([*x[:0:-1], *x]))
            middle += max(len(x) - 1, 0)
        right = (both[0] * both[1]).coeffs()[middle:]
        dropped = sum((abs(x) for x in right[count:]), flint().arb(0)) * 2
        if self.rest or other.rest:
            dropped += self.norm * other.rest + self.rest * (other.norm + other.rest)
        return Even(of(right[:count]), dropped)


def sizes_from(modes: list[Any]) -> list[Any]:
    """Sums of magnitudes from mode n on, of n and of -n, those of mode 0 once; (n + 1,)."""
    total = flint().arb(0)
    sums = [total]
    for n in range(len(modes) - 1, -1, -1):
        total = total + abs(modes[n]) * (2 if n else 1)
        sums.append(total)
    return sums[::-1]


@dataclass(frozen=True)
class Taylor:
    """A spring's derivatives as power series, and bounds on their rests.

    Attributes
    ----------
    coefficients : list of arb
        Of the energy.
    radius, largest : arb
        Of a disc in which the energy is analytic [m], and a bound on its magnitude there [J].
    """

    coefficients: list[Any]
    radius: Any
    largest: Any

    def derivative(self, order: int) -> list[Any]:
        """Coefficients of a derivative."""
        return [x * math.perm(j, order) for j, x in enumerate(self.coefficients) if j >= order]

    def rest(self, order: int, norm: Any) -> Any:
        """A bound on the other coefficients of a derivative times powers of a norm.

        Parameters
        ----------
        order : int
        norm : arb
            [m]

        Returns
        -------
        arb
            inf beyond the disc.
        """
        if not norm < self.radius:
            return flint().arb("inf")
        with precision(flint().ctx.prec, order + 1):
            q = flint().arb_series([norm, 1]) / self.radius
            beyond = self.largest * q ** len(self.coefficients) / (1 - q)
            found = beyond[order] * math.factorial(order)
        return flint().arb(found.abs_upper())

    def of(self, order: int, series: Even, count: int) -> Even:
        """A derivative of the energy, of a series, as one of at most so many modes.

        Parameters
        ----------
        order : int
            1 for the tension.
        series : Even
            Elongations [m].
        count : int

        Returns
        -------
        Even
        """
        terms, of = self.derivative(order), flint().arb_poly
        block = math.isqrt(len(terms)) + 1  # Paterson and Stockmeyer's order of products
        powers = [Even(of([1]), flint().arb(0)), series]
        while len(powers) <= block:
            powers.append(powers[-1].times(series, count))
        total = Even(of([0]), flint().arb(0))
        for first in range((len(terms) - 1) // block * block, -1, -block):
            total = total.times(powers[block], count) if first < len(terms) - block else total
            modes, rest = total.modes, total.rest
            for x, power in zip(terms[first : first + block], powers, strict=False):
                modes, rest = modes + x * power.modes, rest + abs(x) * power.rest
            total = Even(modes, rest)
        return Even(total.modes, total.rest + self.rest(order, series.norm))

    def bound(self, order: int, norm: Any) -> Any:
        """A bound on the norm of a derivative of series of a given norm.

        Parameters
        ----------
        order : int
        norm : arb
            [m]

        Returns
        -------
        arb
        """
        total = flint().arb(0)
        for x in reversed(self.derivative(order)):
            total = total * norm + abs(x)
        return total + self.rest(order, norm)


@dataclass(frozen=True)
class Bounds:
    """What a proof found.

    Attributes
    ----------
    centre : list of arb
        Coefficients of the approximate solution, exact: of the wave [m], on the line of the
        nonlinear part of its tension [N].
    wave : list of arb
        Coefficients of the approximate wave [m].
    y, z1, z2 : arb
    distance, at_peak : arb or None
        Bounds on the distance of the true wave from it on the ring, and at its middle [m]; None
        where the bounds prove nothing.
    tail : arb or None
        A bound on the true wave half a period from its middle [m]; on the line also farther away.
    """

    centre: list[Any]
    wave: list[Any]
    y: Any
    z1: Any
    z2: Any
    distance: Any
    at_peak: Any
    tail: Any


def taylor(spring: BallSpring, norm: float, ends: tuple[float, float]) -> Taylor | None:
    """The series of a spring for waves of a given norm; None where no disc of analyticity holds it.

    Parameters
    ----------
    spring : BallSpring
    norm : float
        [m]
    ends : tuple of float
        Domain of the elongation [m].

    Returns
    -------
    Taylor or None
    """
    end = min(-ends[0], ends[1], 8 * norm)
    for part in REACH:
        radius = flint().arb(norm + part * (end - norm))
        largest = spring.largest(radius) if end > norm else None
        if largest is not None:
            ratio = norm / float(radius)
            terms = min(MOST, math.ceil(math.log(SETTLED) / math.log(ratio)) + 8)
            return Taylor(spring.series(flint().arb(0), terms, flint().ctx.prec), radius, largest)
    return None


def multipliers(count: int, period: Any, momentum: Any) -> list[Any]:
    """mu of the first modes [m/N].

    Parameters
    ----------
    count : int
    period : fmpq
        [sites]
    momentum : fmpq
        m c^2 [N/m]

    Returns
    -------
    list of arb, (count,)
    """
    halves = [flint().arb.pi() * n / period for n in range(count)]
    return [1 / flint().arb(momentum), *((x.sin() / x) ** 2 / momentum for x in halves[1:])]


def _floats(modes: list[Any]) -> Array:
    return np.array([float(x) for x in modes])


def prove_wave(law: Taylor, guess: Any, period: Any, momentum: Any, refine: bool = True) -> Bounds:
    """Bounds for a wave near given coefficients.

    Parameters
    ----------
    law : Taylor
    guess : ndarray or list of arb, (n,)
        Coefficients of the approximate wave [m].
    period : fmpq
        [sites]
    momentum : fmpq
        m c^2 [N/m]
    refine : bool, optional
        Whether it is made more exact first.

    Returns
    -------
    Bounds
    """
    of = flint()
    arb, count = of.arb, len(guess)
    centre = Even(of.arb_poly([arb(x) for x in guess]), arb(0))
    mu = multipliers(2 * count, period, momentum)
    w = _floats(law.of(2, centre, 2 * count).listed(2 * count))
    k, n = np.indices((count, count))
    product = w[np.abs(k - n)] + np.where(n > 0, w[k + n], 0.0)
    system = np.eye(count) - _floats(mu[:count])[:, None] * product
    inverse = np.linalg.pinv(system) if np.isfinite(system).all() else np.eye(count)
    exact = of.arb_mat(count, count, inverse.ravel().tolist())
    for step in range(NEWTON + 1 if refine else 1):
        image = law.of(1, centre, 2 * count)
        forces = image.listed(2 * count)
        off = [x - m * t for x, m, t in zip(centre.listed(2 * count), mu, forces, strict=True)]
        off[:count] = (exact * of.arb_mat(count, 1, off[:count])).entries()
        if refine and step < NEWTON:
            moved = [(x - d).mid() for x, d in zip(centre.listed(count), off, strict=False)]
            centre = Even(of.arb_poly(moved), arb(0))
    size = _largest([arb(1), *_column_norms(exact)])
    far = 1 / (arb.pi() * count / period) ** 2 / momentum  # bounds mu of modes from count on
    y = arb((sizes_from(off)[0] + size * mu[0] * image.rest).abs_upper())
    z1 = arb(_first_bound(exact, mu, law.of(2, centre, 2 * count), size, far).abs_upper())
    modes = centre.listed(count)
    z2 = arb("inf")
    if z1 < 1:
        z2 = arb((size * mu[0] * law.bound(3, centre.norm + 4 * y / (1 - z1))).abs_upper())
    radius = contracted(y, z1, z2)
    last = modes[0] + 2 * sum((x if n % 2 else -x for n, x in enumerate(modes[1:])), arb(0))
    tail = None if radius is None else arb((abs(last) + radius).abs_upper())
    return Bounds(modes, modes, y, z1, z2, radius, radius, tail)


def contracted(y: Any, z1: Any, z2: Any) -> Any:
    """A radius, at most 4 y/(1 - z1), within which one solution is; None where bounds prove none.

    Parameters
    ----------
    y, z1, z2 : arb
        Without radius, of a ball of that radius.

    Returns
    -------
    arb or None
    """
    arb = flint().arb
    if not (z1 < 1 and z2.is_finite()):
        return None
    root = ((1 - z1) ** 2 - 2 * y * z2).sqrt()
    radius = arb((2 * y / (1 - z1 + root) * (1 + arb(2) ** -20)).abs_upper())
    holds = radius <= 4 * y / (1 - z1) and y + z1 * radius + z2 * radius**2 / 2 < radius
    return radius if holds and z1 + z2 * radius < 1 else None


def _largest(values: list[Any]) -> Any:
    """A bound on the largest of some balls."""
    return max((flint().arb(x.abs_upper()) for x in values), key=float)


def _column_norms(matrix: Any) -> list[Any]:
    """Of each column the sum of magnitudes, those of modes n and -n counted apart."""
    first, *others = ([abs(x) for x in row] for row in matrix.tolist())
    sums = [x + 2 * sum(more) for x, *more in zip(first, *others, strict=True)]
    return [sums[0], *(x / 2 for x in sums[1:])]


def _first_bound(exact: Any, mu: list[Any], w: Even, size: Any, far: Any) -> Any:
    """Z1, column by column: those of the matrix, as many beyond it, and all others."""
    count, arb_mat = exact.nrows(), flint().arb_mat
    with precision(ROUGH):
        modes = w.listed(3 * count)
        around = [*modes[2 * count : 0 : -1], *modes]  # of the modes -2 count to 3 count
        rows = []
        for k in range(count):
            differences = around[k + 1 : k + 2 * count + 1][::-1]  # of the modes k - n
            totals = [0, *modes[k + 1 : k + 2 * count]]
            rows.append([mu[k] * (x + y) for x, y in zip(differences, totals, strict=True)])
        near = exact.tolist()
        moved = (exact * arb_mat(rows)).tolist()  # 1 - A (1 - mu w)
        for k, row in enumerate(moved):
            row[:count] = [x - a for x, a in zip(row, near[k], strict=False)]
            row[k] += 1
        columns, sums = _column_norms(arb_mat(moved)), sizes_from(modes)
        for n in range(2 * count):  # rows beyond the matrix
            inside = n < count
            columns[n] += far * ((sums[count - n] + sums[count + n]) / 2 if inside else sums[0])
        columns.append(size * mu[0] * sums[count] + far * sums[0])
        return _largest(columns) + (size * mu[0] + far) * w.rest
