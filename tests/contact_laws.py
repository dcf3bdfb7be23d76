"""Contact laws of an extender: DMT's, Hertz's with a correction, and a table of forces.

Each is a subclass of `Contact` that gives its potential; `OldDMT` gives springs and overlaps at
rest instead.  `force` and `stored` repeat the law in plain NumPy and SciPy.
"""

from dataclasses import dataclass

import numpy as np
import sympy as sp
from scipy.integrate import quad
from scipy.optimize import brentq

from granular import Contact, hertz
from tensegrity import Potential

R = sp.Symbol("r", real=True)
D = sp.Max(-R, 0)


class Law(Contact):
    """A contact whose force is also written in NumPy."""

    def stored(self, d):
        """Energy [J] by quadrature of the force, from the touch."""
        if d <= 0:
            return 0.0
        ends = [x for x in getattr(self, "overlaps", ()) if 0 < x < d]
        # in the root of the overlap, in which all these forces are smooth
        whole = lambda s: 2 * s * float(self.force(s * s))  # noqa: E731
        return sum(
            quad(whole, a**0.5, b**0.5, epsabs=0, epsrel=1e-11)[0]
            for a, b in zip([0, *ends], [*ends, d], strict=True)
        )

    def rest(self, load):
        """Overlap [m] under a load [N], by SciPy's root."""
        if not load and self.force(1e-18) >= 0:
            return 0.0
        return brentq(lambda d: float(self.force(d)) - load, 1e-18, 1e-3, xtol=1e-24, rtol=1e-14)


@dataclass(frozen=True)
class DMT(Law):
    """Derjaguin, Muller and Toporov 1975: K d^(3/2) - pull while in contact."""

    pull: float = 0.0

    @property
    def potential(self):
        k, f = sp.symbols("K F")
        energy = sp.Rational(2, 5) * k * D ** sp.Rational(5, 2) - f * D
        return Potential(energy, R, {k: self.constant, f: self.pull})

    def force(self, d):
        return np.where(d > 0, self.constant * np.maximum(d, 0) ** 1.5 - self.pull, 0.0)


@dataclass(frozen=True)
class OldDMT(Law):
    """The same law, by the spring from rest under a preload and by the overlap there."""

    pull: float = 0.0

    def spring(self, preload=0.0, length=None):
        k, f, p, d0 = sp.symbols("K F p d0")
        gap = sp.Max(d0 - R, 0)
        stored = lambda x: sp.Rational(2, 5) * k * x ** sp.Rational(5, 2) - f * x  # noqa: E731
        values = {k: self.constant, f: self.pull, p: preload, d0: float(self.overlap(preload))}
        return Potential(stored(gap) - stored(d0) + p * R, R, values, length)

    def overlap(self, force):
        return ((np.asarray(force) + self.pull) / self.constant) ** (2 / 3)

    force = DMT.force


@dataclass(frozen=True)
class Corrected(Law):
    """K d^(3/2) + q d^2."""

    q: float = 0.0

    @property
    def potential(self):
        k, q = sp.symbols("K q")
        energy = sp.Rational(2, 5) * k * D ** sp.Rational(5, 2) + q * D**3 / 3
        return Potential(energy, R, {k: self.constant, q: self.q})

    def force(self, d):
        d = np.maximum(d, 0)
        return self.constant * d**1.5 + self.q * d**2


@dataclass(frozen=True)
class Table(Law):
    """Forces at overlaps, linear between them and beyond the last."""

    overlaps: tuple[float, ...] = ()
    forces: tuple[float, ...] = ()

    @property
    def potential(self):
        count = len(self.overlaps)
        x, y = ([sp.S.Zero, *sp.symbols(f"{name}1:{count + 1}")] for name in "xy")
        pieces, stored = [(sp.S.Zero, R > 0)], sp.S.Zero
        for k in range(count):
            width, s = x[k + 1] - x[k], -R - x[k]
            piece = stored + y[k] * s + (y[k + 1] - y[k]) / width * s**2 / 2
            pieces.append((piece, -x[k + 1] < R if k + 1 < count else True))
            stored += (y[k] + y[k + 1]) / 2 * width
        values = zip(x[1:] + y[1:], self.overlaps + self.forces, strict=True)
        return Potential(sp.Piecewise(*pieces), R, dict(values))

    def force(self, d):
        x, y = (np.array([0.0, *z]) for z in (self.overlaps, self.forces))
        d = np.asarray(d, dtype=float)
        last = (y[-1] - y[-2]) / (x[-1] - x[-2])
        return np.where(d > x[-1], y[-1] + last * (d - x[-1]), np.interp(np.maximum(d, 0), x, y))


KINDS = ("DMT", "old DMT", "corrected", "table")


def law_of(kind, s):
    """A law of two partners, other than Hertz's at overlaps of about s [m]."""

    def law(one, other):
        k = hertz(one, other).constant
        if kind == "corrected":
            return Corrected(k, q=k / s**0.5)
        if kind == "table":
            at = s * np.array([0.25, 1.0, 4.0, 16.0])
            return Table(1.0, overlaps=tuple(at.tolist()), forces=tuple((k * at**1.5).tolist()))
        return {"DMT": DMT, "old DMT": OldDMT}[kind](k, pull=k * s**1.5)

    return law


@dataclass(frozen=True)
class Given(Contact):
    """A contact of a potential."""

    law: Potential | None = None

    @property
    def potential(self):
        return self.law
