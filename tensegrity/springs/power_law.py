"""Contacts without tension, whose compressive force is a power of the overlap.

Source: the talk, part II, "Hertz interaction potentials"; the energy is that of
`derivations.contact`, measured from the equilibrium under the preload: V(0) = V'(0) = 0.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.law import DerivedLaw, Law
from tensegrity.printing import call
from tensegrity.springs.potential import Potential
from tensegrity.typing import Length, Positive, Preload

if TYPE_CHECKING:
    import sympy as sp

SMALLEST = 1e-100  # overlap [m] from which a contact counts as closed
LARGEST = 7  # exponent of which products and roots are compiled, if four times it is whole


class PowerLaw(Potential):
    """Unilateral contact, which transmits compression only: tension(r) = -stiffness max(-r, 0)^n.

    With a preload the elongation r is measured from the precompressed equilibrium, and
    tension(r) = preload - stiffness max(r0 - r, 0)^n with r0 = (preload/stiffness)^(1/n).

    Parameters
    ----------
    stiffness : float
        [N/m^n], > 0.
    exponent : float
        n > 0; 3/2 for Hertz's contact of spheres.
    preload : float, optional
        Compressive force at rest [N], >= 0.
    length : float, optional
        Distance of the masses at r = 0 [m].

    Notes
    -----
    For n < 1 the stiffness is unbounded at the loss of contact: a run through it with the default
    step conserves energy to about 1e-3 only, and a `tol` should be given.  Without a preload,
    contact is lost at r = 0, where every motion starts: the stability bound of the step tends to
    zero there, and a run takes a prohibitive number of steps.

    Under a preload the energy is a small difference, V(r) = stored(r0 - r) - stored(r0) +
    preload r.  Near r = 0 it is lost in the round-off of stored(r0), which is stiffness
    r0^(n + 1)/(n + 1), and `energy_error` of a tiny motion is that round-off over its energy.
    The motion itself is not affected: it depends on the tension, whose round-off is that of the
    preload.

    Examples
    --------
    >>> from tensegrity import PowerLaw
    >>> print(PowerLaw(1.0, 1.5).tension([-0.04, 0.01]))
    [-0.008  0.   ]
    """

    _varied = ("stiffness", "exponent", "preload")

    @checked
    def __init__(
        self,
        stiffness: Annotated[float, "> 0", "N/m^n"],
        exponent: Positive,
        preload: Preload = 0.0,
        length: Length | None = None,
    ) -> None:
        try:
            overlap = (preload / stiffness) ** (1 / exponent)
        except OverflowError:
            overlap = math.inf
        overlap = check.number("overlap under the preload", overlap, unit="m")
        values = [stiffness, preload, overlap, exponent]
        domain = (-math.inf, math.inf)
        own = exponent if (4 * exponent).is_integer() and exponent <= LARGEST else None
        self._set(DerivedLaw(_power_law, own), values, length, domain)
        self._numbers = (exponent,)
        self.kinks = ((overlap, stiffness, exponent, -1.0),)
        given: dict[str, Any] = {"stiffness": stiffness, "exponent": exponent, "preload": preload}
        given |= {} if length is None else {"length": self._length}
        self._origin = call("PowerLaw", **given)

    @property
    def exponent(self) -> float:
        """n."""
        return float(self.values[3])

    def _with(self, parameters: dict[str, float]) -> PowerLaw:
        stiffness, preload = parameters["stiffness"], parameters["preload"]
        exponent = parameters.get("exponent", self.exponent)
        return PowerLaw(stiffness, exponent, preload, self._length)

    def _shift_from(self, other: Potential) -> float:
        """Shift of the elongation relative to another contact: the difference of their overlaps at
        rest [m]; see `Potential._shift_from`."""
        return float(self.values[2] - other.values[2])


def _power_law(exponent: float | None) -> Law:
    """The law of one exponent, of which products and roots are compiled, or that of all."""
    import sympy as sp

    from derivations import contact as derived

    r = sp.Symbol("r", real=True)
    parameters = sp.symbols("stiffness preload overlap exponent", real=True)
    stiffness, preload, overlap, n = parameters
    n = n if exponent is None else sp.nsimplify(exponent, rational=True)
    # The base of the power stays above 0, where higher derivatives are infinite and 0 * inf is nan.
    closed, gap = sp.Heaviside(overlap - r - SMALLEST), sp.Symbol("gap")
    pressed = sp.Max(overlap - r, SMALLEST)

    def stored(gap: sp.Expr) -> sp.Expr:
        known = {derived.constant: stiffness, derived.exponent: n, derived.overlap: gap}
        return derived.power_law_energy().subs(known)

    energy = closed * stored(pressed) - stored(overlap) + preload * r
    # differentiated for a closed contact: the derivative of Max would contain a division
    force = sp.powsimp(sp.diff(stored(gap), gap))  # without a quotient by the gap
    tension = preload - closed * force.subs(gap, pressed)
    general = None if exponent is None else DerivedLaw(_power_law, None)
    return Law(energy, r, parameters, tension, general=general)
