"""Polynomial approximations of the tension of a spring over a range of elongations.

The tension is V'(0) + r Q(t) with t = (r - middle)/half: an equilibrium at r = 0 is preserved, and
the energy is the exact antiderivative, so that a chain of polynomials is Hamiltonian.  The
polynomial is a law like any other, with its coefficients as parameters; the degrees are quantised,
so that a few compiled kernels suffice.

Q is computed in exact arithmetic from the Chebyshev coefficients of the tension at `NODES` points.
Its error is estimated by the truncated coefficients and by the largest difference from the spring
on a sample `DENSE` times denser.  The maximum of a polynomial of degree `NODES` exceeds its maximum
on such a sample by a factor of at most 1/cos(pi/(2 DENSE)), about one hundredth (Ehlich & Zeller
1964); the factor `MISSED` covers this and the round-off of a steep law at the sample.  A law with
finer detail can exceed it by more.  A run that chooses polynomials by its
tolerance does not rely on this estimate: it compares trajectories.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.law import deflated, horner
from tensegrity.errors import RangeError, ResolutionError, TensegrityError
from tensegrity.springs.potential import Potential
from tensegrity.typing import Positive

DEGREES = tuple(range(7, 48, 4))
NODES = 96
DENSE = 10  # points of the sample per node
MISSED = 1.05  # largest error over that on the sample
NARROWEST = 1e-100  # smallest range [m]; its inverse squared is finite
UNIT = np.finfo(float).eps / 2


@dataclass(frozen=True)
class PolynomialLaw:
    """A tension that is a polynomial of the elongation.

    Attributes
    ----------
    degree : int
        Degree of the tension.
    """

    degree: int
    compiled = ("energy", "tension")
    name = property(repr)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the interval, the tension at rest, and the coefficients of Q."""
        coefficients = tuple(f"q{k}" for k in range(self.degree))
        return ("middle", "per_half", "tension_at_rest", *coefficients)

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation, parameters, and the energy with its derivatives as CasADi expressions; see
        `law.Law.forms`."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        middle, per_half, at_rest, *q = ca.vertsplit(p)
        t, t_at_rest = (r - middle) * per_half, -middle * per_half
        # r^2 S(t) is the antiderivative of r Q(t): 2 S + (t - t_at_rest) S' = Q
        s = [q[-1] * (1 / (self.degree + 1))]
        for k in range(self.degree - 2, -1, -1):
            s.append((q[k] + (k + 1) * t_at_rest * s[-1]) * (1 / (k + 2)))
        energy = at_rest * r + r * r * horner(s[::-1], t)
        # even and odd powers are two shorter chains of dependent operations
        tension = at_rest + r * (horner(q[::2], t * t) + t * horner(q[1::2], t * t))
        stiffness = ca.gradient(tension, r)
        return r, p, (energy, tension, stiffness, ca.gradient(stiffness, r))


class Polynomial(Potential):
    """A polynomial approximation of a spring's tension over a range of elongations.

    Parameters
    ----------
    spring : Potential
        The spring to approximate.
    low, high : float
        Range of elongation [m], low < 0 < high, inside the spring's domain; it becomes the domain
        of the polynomial.  A wider range needs a higher degree, so give the one that a run visits.
    error : float, optional
        Largest admissible error estimate of the tension, relative to the largest tension on the
        range.

    Attributes
    ----------
    degree : int
        The lowest of 7, 11, ... 47 whose estimate is at most `error`.
    error_estimate : float
        Estimate of the largest error of the tension over its largest value on the range; see
        `tensegrity.springs.polynomial`.

    Raises
    ------
    TensegrityError
        A range that does not contain 0 or leaves the domain, or an error <= 0.
    ResolutionError
        No degree is accurate enough.

    Examples
    --------
    >>> from tensegrity import Polynomial, Prism
    >>> exact = Prism(1.0, 0.7, 0.01, 1.0).potential()
    >>> fitted = Polynomial(exact, -0.02, 0.01, error=1e-10)
    >>> fitted.degree
    15
    >>> bool(abs(fitted.tension(-0.015) / exact.tension(-0.015) - 1) < 1e-9)
    True
    """

    degree: int
    error_estimate: float

    @checked
    def __init__(
        self,
        spring: Potential,
        low: Annotated[float, "m"],
        high: Annotated[float, "m"],
        error: Positive = 1e-12,
    ) -> None:
        if not low < 0 < high:
            raise TensegrityError(f"range ({low:g}, {high:g}) m must contain 0 m inside")
        check.number("width of the range", high - low, least=NARROWEST, unit="m")
        for r in (low, high):
            if not spring.domain[0] <= r <= spring.domain[1]:
                raise spring._range_error(r)
        self._fit(spring, low, high, error)

    def _take(self, degree, values, length, domain):
        self.degree, ends = degree, ("the range of the polynomial ends",) * 2
        self._set(PolynomialLaw(degree), values, length, domain, ends)

    def _fit(self, spring, low, high, error):
        middle, half = low / 2 + high / 2, (high / 2 - low / 2) * (1 + 4 * UNIT)
        f = spring.tension(np.clip(middle + half * _nodes(), low, high))
        peak = float(np.abs(f).max()) or 1.0
        coefficients = _transform() @ f
        tails = np.cumsum(np.abs(coefficients)[::-1])[::-1] / peak
        at_rest = float(spring.tension(0.0))
        between = low + (high - low) * np.sin(_angles(DENSE * NODES) / 2) ** 2
        exact, best = spring.tension(between), math.inf
        for degree in DEGREES:
            estimate = float(tails[degree + 1])
            if estimate <= error:
                values = _parameters(coefficients[: degree + 1], middle, half, at_rest)
                self._take(degree, values, spring.length, (low, high))
                gap = MISSED * float(np.abs(self.tension(between) - exact).max()) / peak
                self.error_estimate = max(estimate, gap)
                if self.error_estimate <= error:
                    return
                estimate = self.error_estimate
            best = min(best, estimate)
        raise ResolutionError(
            f"error {error:g} of a polynomial on ({low:g}, {high:g}) m must be at least "
            f"{best:.2g}, the error of degrees up to {DEGREES[-1]} there"
        )

    @property
    def force_model(self) -> str:
        """The degree of the polynomial and its range."""
        low, high = self.domain
        return f"polynomial of degree {self.degree} on [{low:.4g}, {high:.4g}] m"

    def _range_error(self, r: float) -> RangeError:
        """The error for an elongation at or beyond an end of the range."""
        return RangeError(str(super()._range_error(r)))

    def __repr__(self) -> str:
        estimate = f"error_estimate={self.error_estimate:.2g}"
        return f"Polynomial(degree {self.degree}, domain={self.domain} m, {estimate})"


def polynomial_of_coefficients(
    degree: int,
    values: ArrayLike,
    length: float | None,
    domain: tuple[float, float],
    error_estimate: float,
) -> Polynomial:
    """A polynomial from the coefficients of one that was fitted before.

    Parameters
    ----------
    degree : int
        One of 7, 11, ... 47.
    values : array_like
        Parameters of its law.
    length : float or None
        Length at r = 0 [m].
    domain : (float, float)
        Range of elongation [m].
    error_estimate : float
        Relative error of the tension, >= 0.

    Returns
    -------
    Polynomial

    Raises
    ------
    TensegrityError
        Another degree, or values that do not match it.
    """
    if degree not in DEGREES:
        raise TensegrityError(f"degree {check.shown(degree)} must be one of {DEGREES}")
    made = Polynomial.__new__(Polynomial)
    count = len(PolynomialLaw(degree).parameters)
    made._take(degree, check.vector("coefficients", values, (count,)), length, domain)
    made.error_estimate = check.number("error_estimate", error_estimate, least=0)
    return made


def _angles(count):
    """Angles whose cosines are `count` Chebyshev points."""
    return np.pi * (np.arange(count) + 0.5) / count


@cache
def _nodes():
    return np.cos(_angles(NODES))


@cache
def _transform():
    """Matrix that maps values at the nodes to Chebyshev coefficients."""
    matrix = 2 / NODES * np.cos(np.outer(np.arange(NODES), _angles(NODES)))
    matrix[0] /= 2
    return matrix


def _parameters(chebyshev, middle, half, at_rest):
    """Parameters of a `PolynomialLaw` from Chebyshev coefficients, rounded only at the end."""
    per_half = 1 / half
    now, before = [Fraction(1)], [Fraction(0), Fraction(1)]  # T_0 and T_1, then by recurrence
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
