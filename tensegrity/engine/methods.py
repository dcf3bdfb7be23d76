"""Integration methods as data: rows of coefficients for shared loops.

A step of a `Splitting` is a sequence of kicks (velocities by kicks[i] dt) and drifts (positions
by drifts[i] dt), closed by a last kick.  Such methods are explicit, symplectic and, being
palindromes, time-reversible.  They keep their order where sites are driven or damped, or springs
change with time: see `preserves`.  A step of a `Nystrom` method evaluates accelerations at points
inside the step and sums them; it is none of the latter two.  `Midpoint` is implicit, symplectic
and time-reversible, and stable with any step.
"""

from __future__ import annotations

from fractions import Fraction

from tensegrity import check
from tensegrity.engine.schemes import (
    Corrected,
    Method,
    Midpoint,
    Nystrom,
    Splitting,
    nystrom_of,
    palindrome,
)
from tensegrity.errors import TensegrityError

__all__ = [
    "METHODS",
    "Corrected",
    "Method",
    "Midpoint",
    "Nystrom",
    "Splitting",
    "default",
    "find",
    "nystrom_of",
    "palindrome",
]

_BLANES_MOAN_KICKS = palindrome(
    (
        0.041464998518262400,
        0.198128671918067,
        -0.0400061921041533,
        0.0752539843015807,
        -0.0115113874206879,
    ),
    odd=False,
)
_BLANES_MOAN_DRIFTS = palindrome(
    (
        0.123229775946271,
        0.290553797799558,
        -0.127049212625417,
        -0.246331761062075,
        0.357208872795928,
    ),
    odd=True,
)

_HALF, _SIXTH = Fraction(1, 2), Fraction(1, 6)
_CLASSICAL = ((0, 0, 0, 0), (_HALF, 0, 0, 0), (0, _HALF, 0, 0), (0, 0, 1, 0))
_CLASSICAL_WEIGHTS = (_SIXTH, 2 * _SIXTH, 2 * _SIXTH, _SIXTH)

_RKN6 = Splitting(
    name="rkn6",
    order=6,
    kicks=_BLANES_MOAN_KICKS,
    drifts=_BLANES_MOAN_DRIFTS,
    default_fraction=0.15,
    reference="S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142, 313 (2002), SRKN 11b",
    limitations="springs whose stiffness jumps (opening contacts): the order falls below 3",
)

LOOSE = 1e-3  # tolerance from which openings need no correction
METHODS = {
    method.name: method
    for method in (
        Splitting(
            name="verlet",
            order=2,
            kicks=(0.5, 0.5),
            drifts=(1.0,),
            default_fraction=0.05,
            reference="L. Verlet, Phys. Rev. 159, 98 (1967)",
            limitations="errors below about 1e-3 are wanted: a method of higher order is cheaper",
        ),
        _RKN6,
        Nystrom(
            name="rk4",
            order=4,
            **nystrom_of(_CLASSICAL, _CLASSICAL_WEIGHTS),
            default_fraction=0.05,
            reference="W. Kutta, Z. Math. Phys. 46, 435 (1901)",
            limitations="long runs, since it loses energy, or where cost counts: rkn6 is cheaper at "
            "every accuracy; it is here to compare with results that were made with it",
        ),
        Midpoint(
            name="midpoint",
            order=2,
            default_fraction=0.1,
            reference="E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, VI.3",
            limitations="motions at the highest frequency matter, since it slows them down; errors "
            "below about 1e-3 are wanted; or networks are wide: work grows with the square of how "
            "many sites a cut through them meets.  It is here for few bonds far stiffer than the "
            "rest, whose vibrations are not excited; a step takes some ten evaluations of forces",
        ),
        Corrected(
            name="corrected6",
            order=6,
            base=_RKN6,
            default_fraction=0.15,
            reference="rkn6 and own corrections; the idea: I. Navot, J. Math. Phys. 40, 271 (1961)",
            limitations="no contact opens: steps are those of rkn6, which is reversible in time to "
            "round-off and symplectic.  Corrections are neither: run backwards, it comes back "
            "where it began to its error only",
        ),
    )
}


def find(method: str | Method) -> Method:
    """The method of that name, or the one given, if its rows can be run."""
    if isinstance(method, str) and method in METHODS:
        return METHODS[method]
    if not isinstance(method, (Splitting, Corrected, Nystrom, Midpoint)):
        raise TensegrityError(
            f"method {check.shown(method)} is not one of {', '.join(METHODS)}, nor a Splitting, a "
            "Corrected, a Nystrom or a Midpoint of tensegrity.engine.methods"
        )
    method.check()
    return method


def default(dt: float | None, tol: float | None, opens: bool) -> str:
    """Name of the method used where none is asked for.

    `opens` where a contact can open, and its opening is corrected: not worth its time where a
    `LOOSE` tolerance is met by steps that are stable.
    """
    if dt is not None:
        return "verlet"
    return "corrected6" if opens and (tol is None or tol < LOOSE) else "rkn6"
