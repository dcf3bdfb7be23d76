"""Polynomials in place of the tension of a spring, over a range of elongations.

The tension is V'(0) + r Q(t) with t = (r - middle)/half: what was in equilibrium at r = 0 stays
so, and the energy is its exact antiderivative, so a chain of polynomials is Hamiltonian too.  It
is a law like any other, whose coefficients are parameters; degrees are quantised, so that few
kernels serve all.

Q comes from Chebyshev coefficients of the tension at `NODES` points, by exact arithmetic.  Where
the law is analytic and made of operations that `enclosure` knows, the error is bounded for
certain: interpolation at that many points errs by at most 4 M rho^-n/(rho - 1), M the largest
value on an ellipse about the range (Trefethen, Approximation Theory and Approximation Practice,
theorem 8.2), and the polynomial differs from that interpolant by at most the Lebesgue constant
times its largest difference at the points; add the rounding of Horner's scheme, taken in even
and odd powers (Higham, Accuracy and Stability of Numerical Algorithms, section 5.1).  Elsewhere
the error is estimated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check, enclosure
from tensegrity.codegen import Law, deflated, horner
from tensegrity.errors import RangeError, ResolutionError, TensegrityError
from tensegrity.potential import Potential

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

DEGREES = tuple(range(7, 48, 4))
NODES = 96
LEBESGUE = 2 / math.pi * math.log(NODES) + 1
ELLIPSES = (1.7, 1.5, 1.35, 1.25, 1.15)  # sums of their semi-axes over half the range
ROWS = (6, 16)  # of disks across half an ellipse
DENSE = 10  # points a degree at which an estimate looks
NARROWEST = 1e-100  # range [m] whose inverse squared is still a number
UNIT = np.finfo(float).eps / 2


@dataclass(frozen=True)
class PolynomialLaw:
    """A tension that is a polynomial of the elongation.

    Attributes
    ----------
    degree : int
        Of the tension.
    """

    degree: int
    split = False
    compiled = ("energy", "tension")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names: interval, tension at rest, coefficients of (tension - that)/r."""
        coefficients = tuple(f"q{k}" for k in range(self.degree))
        return ("middle", "per_half", "tension_at_rest", *coefficients)

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The law in CasADi; see `codegen.Law.forms`."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        middle, per_half, at_rest, *q = ca.vertsplit(p)
        t, t_at_rest = (r - middle) * per_half, -middle * per_half
        # r^2 S(t) is the antiderivative of r Q(t): 2 S + (t - t_at_rest) S' = Q
        s = [q[-1] * (1 / (self.degree + 1))]
        for k in range(self.degree - 2, -1, -1):
            s.append((q[k] + (k + 1) * t_at_rest * s[-1]) * (1 / (k + 2)))
        energy = at_rest * r + r * r * horner(s[::-1], t)
        # even and odd powers apart: one chain of dependent operations is what a processor waits for
        tension = at_rest + r * (horner(q[::2], t * t) + t * horner(q[1::2], t * t))
        stiffness = ca.gradient(tension, r)
        return r, p, (energy, tension, stiffness, ca.gradient(stiffness, r))


class Polynomial(Potential):
    """A polynomial that stands for a spring's tension over a range of elongations.

    Parameters
    ----------
    spring : Potential
    low, high : float
        Range [m], low < 0 < high, inside the spring's domain: its own domain.  The wider, the
        higher the degree: give what a run visits.
    error : float, optional
        Wanted largest error of the tension, relative to the largest tension on the range.

    Attributes
    ----------
    degree : int
        The lowest of 7, 11, ... 47 that is good enough.
    error_bound : float or None
        Largest error of the tension over the largest tension on the range, for certain; None
        where the law cannot be bounded.
    error_estimate : float or None
        The same, from the Chebyshev tail and a sample ten times denser, where there is no bound.

    Raises
    ------
    ResolutionError
        If no degree is good enough.

    Examples
    --------
    >>> from tensegrity import Prism
    >>> spring = Polynomial(Prism(1.0, 0.7, 0.01, 1.0).potential(), -0.02, 0.01, error=1e-10)
    >>> spring.error_bound < 1e-10
    True
    """

    def __init__(self, spring: Potential, low: float, high: float, error: float = 1e-12) -> None:
        if not isinstance(spring, Potential):
            raise TensegrityError(f"spring {spring!r} is not a Potential")
        low, high = (check.number("end of the range", x, unit="m") for x in (low, high))
        error = check.number("error", error, above=0)
        if not low < 0 < high:
            raise TensegrityError(f"range ({low:g}, {high:g}) m must contain 0 m inside")
        check.number("width of the range", high - low, least=NARROWEST, unit="m")
        for r in (low, high):
            if not spring.domain[0] <= r <= spring.domain[1]:
                raise spring.beyond(r)
        self._fit(spring, low, high, error)
        self._ends = ("the range of the polynomial ends",) * 2
        self._spring = spring

    def _fit(self, spring, low, high, error):
        middle, half = low / 2 + high / 2, (high / 2 - low / 2) * (1 + 4 * UNIT)
        r = np.clip(middle + half * _nodes(), low, high)
        f = spring.tension(r)
        peak = float(np.abs(f).max()) or 1.0
        coefficients = _transform() @ f
        tails = np.cumsum(np.abs(coefficients)[::-1])[::-1] / peak
        at_rest, truncation = float(spring.tension(0.0)), None
        best = math.inf
        for degree in DEGREES:
            tail = tails[degree + 1]
            if tail > error:
                best = min(best, tail)
                continue
            law = PolynomialLaw(degree)
            values = _parameters(coefficients[: degree + 1], middle, half, at_rest)
            self._set(law, values, spring.length, (low, high))
            self.degree, self.error_bound, self.error_estimate = degree, None, None
            if truncation is None:
                truncation = _truncation(spring, middle, half)
                exact = self._enclosed(spring, r) if math.isfinite(truncation) else None
            bound = truncation
            if exact is not None:
                gap = LEBESGUE * self._largest_gap(exact, r)
                bound = float((truncation + gap + self._rounding()) / peak)
            if math.isfinite(bound):
                self.error_bound = bound
            else:
                between = np.linspace(0, np.pi, DENSE * (degree + 1) + 2)[1:-1]
                dense = low + (high - low) * np.sin(between / 2) ** 2  # closer at the ends
                gap = np.abs(self.tension(dense) - spring.tension(dense)).max() / peak
                self.error_estimate = float(max(tail, gap))
            if self.error <= error:
                return
            best = min(best, self.error)
        raise ResolutionError(
            f"error {error:g} of a polynomial on ({low:g}, {high:g}) m must be at least "
            f"{best:.2g}, what degrees up to {DEGREES[-1]} reach there"
        )

    @property
    def error(self) -> float:
        """The bound of the error, or the estimate where there is no bound."""
        return self.error_estimate if self.error_bound is None else self.error_bound

    @property
    def force(self) -> str:
        """What stands for the tension."""
        low, high = self.domain
        return f"polynomial of degree {self.degree} on [{low:.4g}, {high:.4g}] m"

    def beyond(self, r: float) -> RangeError:
        """The error for an elongation at or beyond an end of the range."""
        return RangeError(str(super().beyond(r)))

    def _enclosed(self, spring, r):
        """The spring's tension on disks about points, wide enough for how the points round."""
        return enclosure.tension(spring._law, spring._values, self._disks(r))

    def _disks(self, r):
        return enclosure.Disk(r, 8 * UNIT * np.abs(self.domain).max())

    def _largest_gap(self, exact, r):
        """Bound of the difference from the exact tension on disks about points [N]."""
        ours = self._enclosed(self, r)
        gap = np.abs(exact.centre - ours.centre) + exact.radius + ours.radius
        return float(np.where(np.isfinite(gap), gap, np.inf).max())

    def _rounding(self):
        """Bound of the rounding in an evaluation [N]; no power of t meets more operations."""
        middle, per_half, at_rest, *q = self._values
        q, farthest = np.abs(q), float(np.abs(self.domain).max())
        operations = 2 * len(q) + 3
        scheme = operations * UNIT / (1 - operations * UNIT) * q.sum()
        argument = 4 * UNIT * (1 + abs(middle) * per_half) * (np.arange(len(q)) * q).sum()
        return farthest * (scheme + argument) + 2 * UNIT * abs(at_rest)

    def __repr__(self) -> str:
        kind = "error_estimate" if self.error_bound is None else "error_bound"
        return f"Polynomial(degree {self.degree}, domain={self.domain} m, {kind}={self.error:.2g})"


@cache
def _nodes():
    return np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)


@cache
def _transform():
    """Matrix from values at the nodes to Chebyshev coefficients."""
    angle = np.pi * (np.arange(NODES) + 0.5) / NODES
    matrix = 2 / NODES * np.cos(np.outer(np.arange(NODES), angle))
    matrix[0] /= 2
    return matrix


def _parameters(chebyshev, middle, half, at_rest):
    """Numbers of a `PolynomialLaw` from Chebyshev coefficients, rounded once at the end."""
    per_half = 1 / half
    now, before = [Fraction(1)], [Fraction(0), Fraction(1)]  # T_0, T_1 and so on, in turn
    powers = [Fraction(0)] * len(chebyshev)
    for coefficient in chebyshev.tolist():
        for k, part in enumerate(now):
            powers[k] += Fraction(coefficient) * part
        after = [Fraction(0), *(2 * x for x in before)]
        now, before = before, [
            x - (now[k] if k < len(now) else 0) for k, x in enumerate(after)
        ]  # fmt: skip
    q = deflated(powers, -Fraction(middle) * Fraction(per_half))
    return [middle, per_half, at_rest, *(float(x * Fraction(per_half)) for x in q)]


def _truncation(spring, middle, half):
    """Bound of the error of interpolation at the nodes [N]; inf where none is found."""
    best = math.inf
    if not isinstance(spring._law, Law):
        return best
    for rho, rows in product(ELLIPSES, ROWS):
        centres, radius = _cover(rho, rows)
        disks = enclosure.Disk(middle + half * centres, half * radius)
        try:
            largest = float(enclosure.tension(spring._law, spring._values, disks).largest.max())
        except enclosure.NotEnclosed:
            return math.inf
        bound = 4 * largest * rho ** (1 - NODES) / (rho - 1)
        if bound >= best and math.isfinite(best):
            break  # a smaller ellipse gains no more
        best = min(best, bound)
        if best <= UNIT * UNIT:
            break
    return best


@cache
def _cover(rho, rows):
    """Centres and the radius of disks that cover the upper half of an ellipse about [-1, 1]."""
    a, b = (rho + 1 / rho) / 2, (rho - 1 / rho) / 2
    side = b / rows
    x, y = np.arange(-a + side / 2, a + side, side), np.arange(side / 2, b + side, side)
    centres = (x[:, None] + 1j * y).ravel()
    radius = side / math.sqrt(2) * 1.001
    # grown by twice the radius an ellipse holds all disks that touch it, if b/a > 0.08
    grown = (centres.real / (a + 2 * radius)) ** 2 + (centres.imag / (b + 2 * radius)) ** 2
    return centres[grown <= 1], radius
