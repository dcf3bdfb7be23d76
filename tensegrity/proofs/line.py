"""Existence of a solitary wave on the infinite line near one on a ring.

With V'(r) = V'(0) + a r + N(r), m c^2 > a, a wave r(x - c t) that vanishes at infinity satisfies
r = G * y, y = N(r), where G has the symbol g(k) = s/(m c^2 - a s), s = (sin(k/2)/(k/2))^2.  As the
triangle with the symbol s is not negative, nor is G, and its moments are closed forms: the integral
of G exp(q x) is g(iq) for all q below the rate of decay.  The unknown is y, in L2, for which G * y
is bounded, and Phi(y) = y - N(G * y) = 0.

Let P = 2 L be the period of the ring, ybar an even trigonometric polynomial there and 0 elsewhere,
G_P the periodic sum of G, rbar = G * ybar on the line and r_P = G_P * ybar on the ring.  For 0 < q
and H = |exp(q |x|) ybar| in L2 of the ring,

    |rbar(x)| <= B exp(-q |x|),   |r_P - rbar| <= C exp(-q (P - |x|)) for |x| <= L,

B = |G exp(q |x|)| H by Schwarz, and C with the periodic sum of G exp(q |x|).  A is the approximate
inverse of 1 - N'(r_P) G_P on the ring and the identity elsewhere: other modes, |x| > L.  Then
D Phi(ybar) differs from what A inverts by N'(rbar) G where one or both points are beyond L, by the
images in G_P, and by N'(rbar) - N'(r_P): each at most exp(-q L), as |N'(rbar(x))| <= M B exp(-q
|x|) with M >= |V'''|, and the residual by exp(-q P).  The Newton-Kantorovich theorem gives one even
y near ybar, and r = G * y is a wave.

Sources: G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (the equation); the bounds
are stated here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.proofs.balls import flint, precision
from tensegrity.proofs.ring import ROUGH, Bounds, Even, Taylor, contracted, multipliers, sizes_from

NEWTON = 5  # steps by which the approximate wave is made more exact
WEIGHT, MARGIN = 0.86, 0.07  # q over the rate of decay; by how much that of the images is larger
ROOM = 1.01  # over the norm of the wave, within which the law is bounded


@dataclass(frozen=True)
class Kernel:
    """G, by m c^2 and a [N/m], on a ring."""

    momentum: Any
    stiffness: Any
    period: Any

    def moment(self, rate: Any) -> Any:
        """The integral of G exp(rate x) [m/N]; not finite at or beyond the rate of decay."""
        half = rate / 2
        symbol = (half.sinh() / half) ** 2 if rate > 0 else flint().arb(1)
        left = self.momentum - self.stiffness * symbol
        return symbol / left if left > 0 else flint().arb("inf")

    def size(self, rate: Any) -> Any:
        """A bound on G exp(rate |x|) in L2: that of the triangle exp(rate x) is at most 2/3
        cosh(2 rate), squared, and the triangle's symbol at most its integral."""
        arb = flint().arb
        half, sides = rate / 2, (2 if rate > 0 else 1)
        symbol = (half.sinh() / half) ** 2 if rate > 0 else arb(1)
        left = self.momentum - self.stiffness * symbol
        triangle = (arb(2) / 3 * (2 * rate).cosh()).sqrt()
        return sides * triangle / left if left > 0 else arb("inf")

    def symbols(self, count: int) -> list[Any]:
        """g of the first modes."""
        found = multipliers(count, self.period, self.momentum)
        return [mu / (1 - self.stiffness * mu) for mu in found]

    def beyond(self, count: int) -> Any:
        """A bound on g of all modes from one on."""
        symbol = 1 / (flint().arb.pi() * count / self.period) ** 2
        left = self.momentum - self.stiffness * symbol
        return symbol / left if left > 0 else flint().arb("inf")


def prove_on_line(
    law: Taylor, guess: Any, period: Any, momentum: Any, rate: float, refine: bool = True
) -> Bounds:
    """Bounds for a wave on the line.

    Parameters
    ----------
    law : Taylor
    guess : ndarray or list of arb, (n,)
        Coefficients of an approximate wave on the ring [m]; without `refine` of ybar [N].
    period : fmpq
        Of the ring [sites].
    momentum : fmpq
        m c^2 [N/m]
    rate : float
        Of decay [1/site]; no bound depends on its being exact.
    refine : bool, optional
        Whether the wave is made more exact first.

    Returns
    -------
    Bounds

    Raises
    ------
    TensegrityError
        V''(0) or the rate is not above 0.
    """
    of, count = flint(), len(guess)
    arb, zero = of.arb, of.arb(0)
    kernel = Kernel(arb(momentum), 2 * law.coefficients[2], period)
    if not (kernel.stiffness > 0 and rate > 0):
        raise TensegrityError(
            f"V''(0) {float(kernel.stiffness):.3g} N/m and the rate of decay {rate:.3g} per site "
            "must be above 0 for a proof on the line"
        )
    law = replace(law, coefficients=[zero, zero, zero, *law.coefficients[3:]])  # N, and not V'
    g = kernel.symbols(2 * count)
    start = Even(of.arb_poly([arb(x) for x in guess]), zero)
    force = law.of(1, start, count) if refine else start
    centre = [x.mid() for x in force.listed(count)]

    def wave(forces: list[Any]) -> Even:
        return Even(of.arb_poly([x * y for x, y in zip(g, forces, strict=False)]), zero)

    inverse, root = _inverse(law.of(2, wave(centre), 2 * count), g, count), arb(2).sqrt()
    for step in range(NEWTON + 1 if refine else 1):
        image = law.of(1, wave(centre), 2 * count)
        off = [x - t for x, t in zip([*centre, *[zero] * count], image.listed(2 * count),
                                     strict=True)]  # fmt: skip
        near = inverse * of.arb_mat(count, 1, [x * (root if n else 1) for n, x in
                                               enumerate(off[:count])])  # fmt: skip
        moved = near.entries()
        if refine and step < NEWTON:
            steps = [d / root if n else d for n, d in enumerate(moved)]
            centre = [(x - d).mid() for x, d in zip(centre, steps, strict=True)]
    ring, w = wave(centre), law.of(2, wave(centre), 2 * count)
    size = _operator(inverse).max(arb(1))
    residual = _l2([*moved, *[root * x for x in off[count:]]]) + size * image.rest
    first = _first_bound(inverse, w, g, kernel, size)
    return _on_line(law, kernel, centre, ring, arb(rate), size, residual, first)


def _on_line(
    law: Taylor, kernel: Kernel, centre: list[Any], ring: Even, rate: Any, size: Any,
    residual: Any, first: Any,
) -> Bounds:  # fmt: skip
    """The bounds of the ring with what the line adds; see above."""
    arb, period, half = flint().arb, flint().arb(kernel.period), flint().arb(kernel.period) / 2
    q, more = (rate * WEIGHT).mid(), (rate * MARGIN).mid()
    within = arb((ROOM * ring.norm).abs_upper())
    third = law.bound(3, within)
    weighted = _weighted(centre, q, kernel.period)
    images = 1 + 2 * (-more * half).exp() / (1 - (-more * period).exp())
    b = kernel.size(q) * weighted
    c = kernel.size(q + more) * images * weighted
    still, moment = kernel.moment(arb(0)), kernel.moment(q)
    far, apart = (-q * half).exp(), (-q * period).exp()
    y = period.sqrt() * (residual + size * third * c * (b + c) * apart)
    y = arb((y + third * b**2 / 2 * far**2 / (2 * q).sqrt()).abs_upper())
    z1 = first + size * third * far * (c * still + 4 * b * moment + b * still)
    z1 = arb(z1.abs_upper())
    bounded = kernel.size(arb(0))
    z2 = arb((size * third * bounded * still).abs_upper())
    radius, modes = contracted(y, z1, z2), ring.listed(len(centre))
    if radius is not None:
        tail = arb((bounded * radius + b * far).abs_upper())
        distance = arb((bounded * radius + c * far).abs_upper())
        if ring.norm + distance < within and tail < within:
            peak = arb((bounded * radius + c * apart).abs_upper())
            return Bounds(centre, modes, y, z1, z2, distance, peak, tail)
    return Bounds(centre, modes, y, z1, z2, None, None, None)


def _weighted(centre: list[Any], q: Any, period: Any) -> Any:
    """H: exp(q |x|) ybar in L2 of the ring, by the closed form of its square."""
    arb, count = flint().arb, len(centre)
    poly = Even(flint().arb_poly(centre), arb(0))
    square = poly.times(poly, 2 * count).listed(2 * count)
    grown, total = (q * period).exp(), arb(0)
    for n, x in enumerate(square):
        k = 2 * arb.pi() * n / period
        part = 4 * q * ((-grown if n % 2 else grown) - 1) / (4 * q**2 + k**2)
        total += x * part * (2 if n else 1)
    return arb(total.abs_upper()).sqrt()


def _inverse(w: Even, g: list[Any], count: int) -> Any:
    """An approximate inverse of 1 - N' G among the first modes, of unit length; exact numbers."""
    values = np.array([float(x) for x in w.listed(2 * count)])
    k, n = np.indices((count, count))
    product = values[np.abs(k - n)] + values[k + n]
    product[0], product[:, 0] = math.sqrt(2) * values[:count], math.sqrt(2) * values[:count]
    product[0, 0] = values[0]
    system = np.eye(count) - product * np.array([float(x) for x in g[:count]])
    found = np.linalg.pinv(system) if np.isfinite(system).all() else np.eye(count)
    return flint().arb_mat(count, count, found.ravel().tolist())


def _first_bound(inverse: Any, w: Even, g: list[Any], kernel: Kernel, size: Any) -> Any:
    """A bound on 1 - A (1 - N'(r_P) G_P) in L2 of the ring: of the matrix and of the modes beyond
    it, by blocks."""
    arb, count = flint().arb, inverse.nrows()
    with precision(ROUGH):
        modes, root = w.listed(2 * count + 1), arb(2).sqrt()
        rows = []
        for k in range(count):
            row = [modes[abs(k - n)] + modes[k + n] for n in range(count)]
            row = [modes[n] * root for n in range(count)] if k == 0 else row
            row[0] = modes[k] * (root if k else 1)
            rows.append([-x * y for x, y in zip(row, g, strict=False)])
            rows[k][k] += 1
        product = (inverse * flint().arb_mat(rows)).tolist()
        for k, row in enumerate(product):
            row[k] -= 1
        inside = _l2([x for row in product for x in row])
        squares, total = [arb(0)], arb(0)
        for x in reversed(modes):
            total += x**2
            squares.append(total)
        squares = squares[::-1]  # sums of squares from mode n on
        below = sum(
            (g[n] ** 2 * 2 * (squares[count - n] + squares[count + n]) for n in range(count)),
            arb(0),
        ).sqrt()
        norm, far = sizes_from(modes)[0], kernel.beyond(count)
        return inside + below + (1 + size) * norm * far + size * w.rest * g[0]


def _l2(values: list[Any]) -> Any:
    """The root of a sum of squares."""
    total = sum((x**2 for x in values), flint().arb(0))
    return flint().arb(total.abs_upper()).sqrt()


def _operator(matrix: Any) -> Any:
    """A bound on a matrix in l2: the geometric mean of its largest sums of rows and columns."""
    arb = flint().arb
    rows = [[abs(x) for x in row] for row in matrix.tolist()]
    sums = [[sum(row, arb(0)) for row in of] for of in (rows, zip(*rows, strict=True))]
    largest = [max((arb(x.abs_upper()) for x in one), key=float) for one in sums]
    return (largest[0] * largest[1]).sqrt()
