"""Integration methods as data: rows of coefficients for shared loops.

A step of a `Splitting` is a sequence of kicks (velocities by kicks[i] dt) and drifts (positions
by drifts[i] dt), closed by a last kick.  Such methods are explicit, symplectic and, being
palindromes, time-reversible.  They keep their order where sites are driven or damped, or springs
change with time: see `preserves`.  A step of a `Nystrom` method evaluates accelerations at points
inside the step and sums them; it is neither symplectic nor time-reversible.  `Midpoint` is
implicit, symplectic and time-reversible, and stable with any step.
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
    "RK8",
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

_DORMAND_PRINCE = (
    (),
    (0.05260015195876773,),
    (0.0197250569845379, 0.0591751709536137),
    (0.02958758547680685, 0, 0.08876275643042054),
    (0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792),
    (0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242),
    (0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125),
    (
        0.03709200011850479,
        0,
        0,
        0.17038392571223998,
        0.10726203044637328,
        -0.015319437748624402,
        0.008273789163814023,
    ),
    (
        0.6241109587160757,
        0,
        0,
        -3.3608926294469414,
        -0.868219346841726,
        27.59209969944671,
        20.154067550477894,
        -43.48988418106996,
    ),
    (
        0.47766253643826434,
        0,
        0,
        -2.4881146199716677,
        -0.590290826836843,
        21.230051448181193,
        15.279233632882423,
        -33.28821096898486,
        -0.020331201708508627,
    ),
    (
        -0.9371424300859873,
        0,
        0,
        5.186372428844064,
        1.0914373489967295,
        -8.149787010746927,
        -18.52006565999696,
        22.739487099350505,
        2.4936055526796523,
        -3.0467644718982196,
    ),
    (
        2.273310147516538,
        0,
        0,
        -10.53449546673725,
        -2.0008720582248625,
        -17.9589318631188,
        27.94888452941996,
        -2.8589982771350235,
        -8.87285693353063,
        12.360567175794303,
        0.6433927460157636,
    ),
)
_DORMAND_PRINCE_WEIGHTS = (
    0.054293734116568765,
    0,
    0,
    0,
    0,
    4.450312892752409,
    1.8915178993145003,
    -5.801203960010585,
    0.3111643669578199,
    -0.1521609496625161,
    0.20136540080403034,
    0.04471061572777259,
)

_RKN6 = Splitting(
    name="rkn6",
    order=6,
    kicks=_BLANES_MOAN_KICKS,
    drifts=_BLANES_MOAN_DRIFTS,
    default_fraction=0.15,
    reference="S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142, 313 (2002), SRKN 11b",
    limitations="where stiffness jumps, as at the loss of a contact, its order falls below 3",
)

LOOSE = 1e-3  # tolerance from which the loss of contacts needs no correction
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
            limitations="for errors below about 1e-3 a method of higher order is cheaper",
        ),
        _RKN6,
        Nystrom(
            name="rk4",
            order=4,
            **nystrom_of(_CLASSICAL, _CLASSICAL_WEIGHTS),
            default_fraction=0.05,
            reference="W. Kutta, Z. Math. Phys. 46, 435 (1901)",
            limitations="it loses energy in long runs, and rkn6 is cheaper at every accuracy; it "
            "serves to compare with results that were obtained with it",
        ),
        Midpoint(
            name="midpoint",
            order=2,
            default_fraction=0.1,
            reference="E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, VI.3",
            limitations="it slows down motions at the highest frequencies; for errors below about "
            "1e-3 methods of higher order are cheaper; its cost grows with the square of the "
            "number of sites in a cross-section of a network.  It serves for a few bonds far "
            "stiffer than the others, whose vibrations are not excited; a step takes about ten "
            "force evaluations",
        ),
        Corrected(
            name="corrected6",
            order=6,
            base=_RKN6,
            default_fraction=0.15,
            reference="rkn6 and own corrections; the idea: I. Navot, J. Math. Phys. 40, 271 (1961)",
            limitations="its corrections are neither symplectic nor time-reversible: a reversed "
            "run returns to its start within the error only.  Where no contact is lost its steps "
            "are those of rkn6, which is both",
        ),
    )
}

RK8 = Nystrom(
    name="rk8",
    order=8,
    **nystrom_of(_DORMAND_PRINCE, _DORMAND_PRINCE_WEIGHTS),
    default_fraction=0.25,
    reference="E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential "
    "Equations I, II.5: the method of order 8 of J. R. Dormand and P. J. Prince",
    limitations="it loses energy in long runs; it serves where forces depend on velocity",
)  # for forces that depend on velocity
BY_NAME = METHODS | {RK8.name: RK8}


def find(method: str | Method) -> Method:
    """The method of a given name, or a method itself, if its rows are valid."""
    if isinstance(method, str) and method in BY_NAME:
        return BY_NAME[method]
    if not isinstance(method, (Splitting, Corrected, Nystrom, Midpoint)):
        raise TensegrityError(
            f"method {check.shown(method)} is not one of {', '.join(METHODS)}, nor a Splitting or "
            "a Nystrom"
        )
    method.check()
    return method


def default(dt: float | None, tol: float | None, opens: bool, rates: bool = False) -> str:
    """Name of the default method.

    Parameters
    ----------
    dt : float or None
        Step given by the user [s].
    tol : float or None
        Tolerance given by the user.  A `LOOSE` one is met by any stable step.
    opens : bool
        Whether contacts can be lost in a way that `Corrected` methods treat.
    rates : bool, optional
        Whether forces may depend on velocity.

    Returns
    -------
    str
    """
    if rates:
        return "rk8" if dt is None else "rk4"
    if dt is not None:
        return "verlet"
    return "corrected6" if opens and (tol is None or tol < LOOSE) else "rkn6"
