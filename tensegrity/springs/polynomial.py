"""Polynomials in place of the tension of a spring, over a range of elongations.

The tension is V'(0) + r Q(t) with t = (r - middle)/half: what was in equilibrium at r = 0 stays
so, and the energy is its exact antiderivative, so a chain of polynomials is Hamiltonian too.  It
is a law like any other, whose coefficients are parameters; degrees are quantised, so that few
kernels serve all.

Q comes from Chebyshev coefficients of the tension at `NODES` points, by exact arithmetic.  Its
error is estimated: by the coefficients left out, and by the largest difference from the spring on
a sample `DENSE` times denser.  A polynomial of degree `NODES` nowhere exceeds what such a sample
sees of it by more than 1/cos(pi/(2 DENSE)), a hundredth (Ehlich & Zeller 1964); a law with finer
detail than that can.  A run that chooses polynomials by its tolerance does not rest on it: it
compares motions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine.law import deflated, horner
from tensegrity.errors import RangeError, ResolutionError, TensegrityError
from tensegrity.springs.potential import Potential

DEGREES = tuple(range(7, 48, 4))
NODES = 96
DENSE = 10  # points of the sample for each node
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
    compiled = ("energy", "tension")
    name = property(repr)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names: interval, tension at rest, coefficients of (tension - that)/r."""
        coefficients = tuple(f"q{k}" for k in range(self.degree))
        return ("middle", "per_half", "tension_at_rest", *coefficients)

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The law in CasADi; see `law.Law.forms`."""
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
        Wanted largest error of the tension, relative to the largest tension on the range, as far
        as a sample tells.

    Attributes
    ----------
    degree : int
        The lowest of 7, 11, ... 47 that is good enough.
    error_estimate : float
        Of the tension's largest error over its largest value on the range; see the module.

    Raises
    ------
    ResolutionError
        If no degree is good enough.

    Examples
    --------
    >>> from tensegrity import Prism
    >>> spring = Polynomial(Prism(1.0, 0.7, 0.01, 1.0).potential(), -0.02, 0.01, error=1e-10)
    >>> spring.error_estimate < 1e-10
    True
    """

    degree: int
    error_estimate: float

    def __init__(self, spring: Potential, low: float, high: float, error: float = 1e-12) -> None:
        check.kind("spring", spring, Potential)
        low, high = (check.number("end of the range", x, unit="m") for x in (low, high))
        error = check.number("error", error, above=0)
        if not low < 0 < high:
            raise TensegrityError(f"range ({low:g}, {high:g}) m must contain 0 m inside")
        check.number("width of the range", high - low, least=NARROWEST, unit="m")
        for r in (low, high):
            if not spring.domain[0] <= r <= spring.domain[1]:
                raise spring.beyond(r)
        self._fit(spring, low, high, error)

    @classmethod
    def of_coefficients(
        cls,
        degree: int,
        values: ArrayLike,
        length: float | None,
        domain: tuple[float, float],
        error_estimate: float,
    ) -> Polynomial:
        """A polynomial from the numbers of one that was fitted."""
        if degree not in DEGREES:
            raise TensegrityError(f"degree {check.shown(degree)} must be one of {DEGREES}")
        made = cls.__new__(cls)
        count = len(PolynomialLaw(degree).parameters)
        made._take(degree, check.vector("coefficients", values, (count,)), length, domain)
        made.error_estimate = check.number("error_estimate", error_estimate, least=0)
        return made

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
                gap = float(np.abs(self.tension(between) - exact).max()) / peak
                self.error_estimate = max(estimate, gap)
                if self.error_estimate <= error:
                    return
                estimate = self.error_estimate
            best = min(best, estimate)
        raise ResolutionError(
            f"error {error:g} of a polynomial on ({low:g}, {high:g}) m must be at least "
            f"{best:.2g}, what degrees up to {DEGREES[-1]} reach there"
        )

    @property
    def force_model(self) -> str:
        """What stands for the tension."""
        low, high = self.domain
        return f"polynomial of degree {self.degree} on [{low:.4g}, {high:.4g}] m"

    def beyond(self, r: float) -> RangeError:
        """The error for an elongation at or beyond an end of the range."""
        return RangeError(str(super().beyond(r)))

    def __repr__(self) -> str:
        estimate = f"error_estimate={self.error_estimate:.2g}"
        return f"Polynomial(degree {self.degree}, domain={self.domain} m, {estimate})"


def _angles(count):
    """Angles whose cosines are the Chebyshev points of that number."""
    return np.pi * (np.arange(count) + 0.5) / count


@cache
def _nodes():
    return np.cos(_angles(NODES))


@cache
def _transform():
    """Matrix from values at the nodes to Chebyshev coefficients."""
    matrix = 2 / NODES * np.cos(np.outer(np.arange(NODES), _angles(NODES)))
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
