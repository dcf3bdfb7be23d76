"""Integration methods as data: rows of coefficients for one shared loop.

A step is a sequence of kicks (velocities by kicks[i] dt) and drifts (positions by drifts[i]
dt), closed by a last kick.  Methods of this kind are explicit, symplectic and, being
palindromes, time-reversible.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensegrity.errors import TensegrityError

ROUGH = 1e-3  # for tolerances from here on the simplest method is cheapest


@dataclass(frozen=True)
class Method:
    """A splitting method.

    Attributes
    ----------
    name : str
    order : int
        Global error ~ dt^order on smooth springs.
    kicks : tuple, (stages + 1,)
    drifts : tuple, (stages,)
    step : float
        Default dt over the stability limit.
    reference : str
    when_not : str
        Where another method serves better.
    """

    name: str
    order: int
    kicks: tuple[float, ...]
    drifts: tuple[float, ...]
    step: float
    reference: str
    when_not: str

    @property
    def stages(self):
        """Force evaluations per step."""
        return len(self.drifts)

    @cached_property
    def stability_limit(self):
        """Largest stable dt * omega on the harmonic oscillator.

        Found from the coefficients: a step is a 2 x 2 matrix of determinant 1, stable while
        its trace lies within [-2, 2].
        """
        z = np.linspace(0, 2.0 * self.stages + 1, 200_001)[1:]
        first = int(np.flatnonzero(np.abs(self._trace(z)) > 2 + 1e-9)[0])
        low, high = (z[first - 1] if first else 0.0), z[first]
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if abs(self._trace(middle)) <= 2 else (low, middle)
        return float(low)

    def _trace(self, z):
        """Trace of a step's matrix for (x, v/omega), z = dt * omega."""
        one, nil = np.ones_like(z, dtype=float), np.zeros_like(z, dtype=float)
        x, v = [one, nil], [nil, one]  # rows: dependence on the initial (x, v)
        for kick, drift in zip(self.kicks, (*self.drifts, 0.0), strict=True):
            v = [b - kick * z * a for a, b in zip(x, v, strict=True)]
            x = [a + drift * z * b for a, b in zip(x, v, strict=True)]
        return x[0] + v[1]


def _palindrome(kicks, drifts):
    """Full rows from the first halves; the middle drift makes the sum 1, as does the last kick."""
    kicks = (*kicks, 0.5 - sum(kicks))
    drifts = (*drifts, 1 - 2 * sum(drifts))
    return kicks + kicks[::-1], drifts + drifts[-2::-1]


_BLANES_MOAN = _palindrome(
    kicks=(
        0.041464998518262400,
        0.198128671918067,
        -0.0400061921041533,
        0.0752539843015807,
        -0.0115113874206879,
    ),
    drifts=(
        0.123229775946271,
        0.290553797799558,
        -0.127049212625417,
        -0.246331761062075,
        0.357208872795928,
    ),
)

METHODS = {
    method.name: method
    for method in (
        Method(
            name="verlet",
            order=2,
            kicks=(0.5, 0.5),
            drifts=(1.0,),
            step=0.05,
            reference="L. Verlet, Phys. Rev. 159, 98 (1967)",
            when_not="errors below about 1e-3 are wanted: a method of higher order is cheaper",
        ),
        Method(
            name="rkn6",
            order=6,
            kicks=_BLANES_MOAN[0],
            drifts=_BLANES_MOAN[1],
            step=0.15,
            reference="S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142, 313 (2002), SRKN 11b",
            when_not="springs whose stiffness jumps (opening contacts): the order falls below 3",
        ),
    )
}


def find(name):
    """The method of that name."""
    if name not in METHODS:
        raise TensegrityError(f"method {name!r} is not one of {', '.join(METHODS)}")
    return METHODS[name]


def default(dt, tol):
    """Name of the method used where none is asked for."""
    return "verlet" if dt is not None or (tol is not None and tol >= ROUGH) else "rkn6"
