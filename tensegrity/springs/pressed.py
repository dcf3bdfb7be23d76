"""Contacts of any law: the overlap under a load, and the spring from the equilibrium there.

A contact's own potential V counts the elongation from the touch, as minus the overlap.  From the
overlap d under a compressive preload P the energy is V(r - d) - V(-d) + P r.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.law import Law, functions
from tensegrity.errors import TensegrityError
from tensegrity.printing import number_text
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw

if TYPE_CHECKING:
    from collections.abc import Callable

    from tensegrity.springs.collection import Springs
    from tensegrity.typing import Array

OVERLAPS = 2.0 ** np.arange(-332, 101)  # m, about 1e-100 to 1e30: where a crossing is bracketed


def overlap_under(potential: Potential, load: float) -> float:
    """The least overlap at which a contact bears a load and more beyond it.

    Parameters
    ----------
    potential : Potential
        Of the elongation from the touch.
    load : float
        Compressive force [N], >= 0.

    Returns
    -------
    float
        [m]; at no load 0, unless the partners attract each other.

    Raises
    ------
    TensegrityError
        A load that the contact does not bear anywhere in its domain.
    """
    if isinstance(potential, PowerLaw):
        return float((load / potential.values[0]) ** (1 / potential.exponent))
    found = crossing(potential, lambda d: -potential.tension(-d), load)
    if found is None:
        raise TensegrityError(f"contact force {load:g} N is never borne by {potential!r}")
    return found


def rest_overlaps(springs: Springs) -> Array:
    """Overlap of each contact without load [m], > 0 where it attracts; (contacts,)."""
    rest = np.array([overlap_under(law, 0.0) for law in springs.different])
    return rest[springs.group] if len(rest) else rest


def crossing(
    potential: Potential, value: Callable[[Array], Array], level: float, side: int = -1
) -> float | None:
    """The least overlap in the domain beyond which a value exceeds a level.

    Parameters
    ----------
    potential : Potential
    value : callable overlaps [m] -> values
    level : float
    side : {-1, 1}, optional
        Sign of the elongations that are counted; of overlaps -1.

    Returns
    -------
    float or None
        [m]; 0 where the value was never below, None where it never exceeds the level.
    """
    from scipy.optimize import brentq

    deepest = np.nextafter(side * potential.domain[side > 0], 0.0)
    overlaps = np.append(OVERLAPS[deepest > OVERLAPS], min(deepest, 2 * OVERLAPS[-1]))
    values = value(overlaps)
    above = np.flatnonzero(values > level)
    if not len(above):
        return None
    first = int(above[0])
    if not (values[:first] < level).any():
        return 0.0
    ends = overlaps[first - 1], overlaps[first]
    return float(brentq(lambda d: float(value(d)) - level, *ends, xtol=1e-300, rtol=1e-15))


def pressed(potential: Potential, preload: float, length: float | None = None) -> Potential:
    """A contact's spring from its equilibrium under a preload.

    Parameters
    ----------
    potential : Potential
        Of the elongation from the touch.
    preload : float
        Compressive force at rest [N], >= 0.
    length : float, optional
        Distance of the masses at rest [m].

    Returns
    -------
    Potential

    Raises
    ------
    TensegrityError
        A preload that the contact does not bear, or a law that is not an expression.
    """
    if isinstance(potential, PowerLaw):
        return PowerLaw(float(potential.values[0]), potential.exponent, preload, length)
    return Pressed(potential, preload, overlap_under(potential, preload), length)


class Pressed(Potential):
    """A contact's spring that counts the elongation from an overlap [m], under a preload [N]."""

    def __init__(
        self, touching: Potential, preload: float, overlap: float, length: float | None = None
    ) -> None:
        import sympy as sp

        law, (low, high) = touching.law, touching.domain
        if not getattr(law, "is_expression", False) or law.through:
            raise TensegrityError(f"{touching!r} is no expression that a preload could shift")
        taken, r = {str(s) for s in (*law.parameters, law.elongation)}, law.elongation
        names = ["preload", "overlap"]
        while taken & {*names}:
            names = [f"{name}_" for name in names]
        load, place = sp.symbols(names, real=True)
        energy = law.energy.xreplace({r: r - place}) - law.energy.xreplace({r: -place}) + load * r
        tension = None if law.tension is None else law.tension.xreplace({r: r - place}) + load
        given = len(touching.parameters)
        symbols = *law.parameters[:given], load, place, *law.parameters[given:]
        values = [*touching.values[:given], preload, overlap, *touching.numbers]
        moved, self._numbers = Law(energy, r, symbols, tension), touching._numbers
        self._set(moved, values, length, (low + overlap, high + overlap), touching.ends)
        self.kinks = tuple((place + overlap, *rest) for place, *rest in touching.kinks)
        self._touching, self._place = touching, given + 1
        load, at = number_text(preload), number_text(overlap)
        self._origin = f"Pressed({touching!r}, preload={load}, overlap={at})"

    def _with(self, parameters: dict[str, float]) -> Potential:
        *own, (_, preload), _ = parameters.items()
        return pressed(self._touching._with(dict(own)), preload, self._length)

    def _shift_from(self, other: Potential) -> float:
        return float(self.values[self._place] - other.values[self._place])

    def slopes(self, name: str) -> Array:
        """Derivatives of the parameters by one of them: the overlap changes such that the tension
        at rest stays 0."""
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.values))
        tension = functions(self.law)["tension"](r, p)
        by = np.array(ca.Function("by", [r, p], [ca.gradient(tension, p)])(0.0, self.values))
        row = np.eye(len(self.values))[list(self.parameters).index(name)]
        by_overlap = by[self._place, 0]
        row[self._place] = -by.ravel() @ row / by_overlap if by_overlap else 0.0
        return row
