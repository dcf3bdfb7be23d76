"""Scalar potentials of a bond: energy, tension and stiffness against elongation.

A potential is a law (what is compiled) with numbers for its parameters.  Prisms and power laws
are measured from their equilibrium under the preload: V(0) = V'(0) = 0.  A power law pushes only,
by a power of how far a contact is pressed together: seeds/000, part II, "Hertz interaction
potentials"; its energy is that of `derivations.contact`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.law import DerivedLaw, Law, check_law
from tensegrity.errors import LockingError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.springs.kinks import kinks

if TYPE_CHECKING:
    from collections.abc import Hashable
    from typing import Any

    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.springs.kinks import Kink
    from tensegrity.typing import Array


ORDERS = ("energy", "tension", "stiffness", "slope of the stiffness")
SMALLEST = 1e-100  # overlap [m] from which a contact counts as closed
VARIED = ("prestrain", "k_cross", "k_base", "k_bar", "preload")  # arguments of a prism that may


class Potential:
    """Energy of a spring as a function of its elongation.

    Parameters
    ----------
    energy : sympy.Expr
        V(r) [J], in `elongation` and the symbols in `parameters`.  It is taken as given: for
        a chain to be at rest at r = 0, V'(0) must be 0.
    elongation : sympy.Symbol
        r [m], extension > 0.
    parameters : dict, optional
        Numbers for the other symbols of `energy`: {Symbol or its name: float}.  Chains that
        differ in these numbers only share one compiled kernel.
    length : float, optional
        Length [m] at r = 0: the lattice spacing, by which strains are taken.
    domain : (float, float), optional
        Lowest and highest elongation [m] the spring can reach.

    Examples
    --------
    >>> import sympy as sp
    >>> r, k = sp.symbols("r k")
    >>> toda = Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0})
    >>> float(toda.stiffness(0.0))
    2.0
    """

    origin = ""  # the call that made it, where that is another than its class
    made_of: Any = None  # the prism and the preload, of one made by a prism

    def __init__(
        self,
        energy: sp.Expr | float,
        elongation: sp.Symbol,
        parameters: Mapping[Any, float] | None = None,
        length: float | None = None,
        domain: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:
        import sympy as sp

        if not isinstance(elongation, sp.Symbol):
            raise TensegrityError(f"elongation {check.shown(elongation)} is not a SymPy symbol")
        if isinstance(energy, (int, float)):
            energy = sp.sympify(check.number("energy", energy, unit="J"))
        if not isinstance(energy, sp.Expr):
            raise TensegrityError(f"energy {check.shown(energy)} is not a SymPy expression")
        parameters = {} if parameters is None else parameters
        if not isinstance(parameters, Mapping):
            raise TensegrityError(f"parameters {check.shown(parameters)} must be a dict of numbers")
        given = {str(key): value for key, value in parameters.items()}
        symbols = sorted(energy.free_symbols - {elongation}, key=str)
        names = [str(s) for s in symbols]
        unknown = sorted(set(given) - set(names))
        if unknown or len(set(names)) < len(names):
            raise TensegrityError(
                f"parameters {', '.join(unknown or names)}: each must name one symbol of the energy"
            )
        missing = [name for name in names if name not in given]
        if missing:
            raise TensegrityError(f"no value for the parameter {', '.join(missing)} of the energy")
        values = [check.number(f"parameter {s}", given[str(s)]) for s in symbols]
        law = Law(energy, elongation, tuple(symbols))
        check_law(law)
        self._set(law, values, length, domain)

    def _set(
        self,
        law: Law,
        values: ArrayLike,
        length: float | None,
        domain: tuple[float, float],
        ends: tuple[str, str] = ("lowest", "highest"),
    ) -> None:
        self.law = law
        self.values = fixed(np.array(values, dtype=float))
        self._length = None if length is None else check.number("length", length, above=0, unit="m")
        ends_of_it = check.sequence("domain", domain, "two elongations")
        if len(ends_of_it) != 2:
            raise TensegrityError(
                f"domain {check.shown(domain)} must be (lowest, highest) elongation"
            )
        low, high = (check.number("domain end", x, finite=False) for x in ends_of_it)
        if not low < 0 < high:
            raise TensegrityError(f"domain ({low:g}, {high:g}) m must contain 0 m inside")
        self._domain = low, high
        self.ends = ends

    @classmethod
    def from_law(
        cls,
        law: Law,
        values: ArrayLike,
        length: float | None,
        domain: tuple[float, float],
        ends: tuple[str, str],
        origin: str = "",
        made_of: Any = None,
    ) -> Potential:
        """A potential from a law that brings more than its energy, and the call it came from."""
        potential = cls.__new__(cls)
        potential._set(law, values, length, domain, ends)
        potential.origin = origin
        potential.made_of = made_of
        return potential

    def varied(self, values: Mapping[str, float]) -> Potential:
        """The same spring with other arguments: of its prism or the preload, or parameters.

        Parameters
        ----------
        values : dict of str to float

        Raises
        ------
        TensegrityError
            It has no such argument, or not with that value.
        """
        if not isinstance(values, Mapping):
            raise TensegrityError(f"values {check.shown(values)} must be a dict of numbers")
        known = VARIED if self.made_of else tuple(self.parameters)
        unknown = [name for name in values if name not in known]
        if unknown:
            raise TensegrityError(
                f"{unknown[0]!r} is no argument of {check.shown(self)} that may change: "
                f"{', '.join(known) or 'there are none'}"
            )
        if self.made_of:
            prism, preload = self.made_of
            given = dict(values)
            preload = given.pop("preload", preload)
            return replace(prism, **given).potential(preload)
        return self._with(self.parameters | dict(values))

    def argument(self, name: str) -> float:
        """What `varied` would change: an argument of its prism, the preload, or a parameter."""
        if self.made_of:
            prism, preload = self.made_of
            return float(preload if name == "preload" else getattr(prism, name))
        return self.parameters[name]

    def _with(self, parameters: dict[str, float]) -> Potential:
        other = copy(self)
        for name in ("_hash", "openings"):
            other.__dict__.pop(name, None)
        values = [check.number(f"parameter {name}", x) for name, x in parameters.items()]
        other.values = fixed(np.array(values))
        return other

    def shift_from(self, other: Potential) -> float:
        """Its elongation [m] where `other`, which it was varied from, has none: prisms and
        contacts are measured from an equilibrium that depends on their arguments."""
        if self.made_of:
            return float(other.length or 0.0) - float(self.length or 0.0)
        return 0.0

    @property
    def length(self) -> float | None:
        """Length at r = 0 [m], or None where none was given."""
        return self._length

    @property
    def domain(self) -> tuple[float, float]:
        """(lowest, highest) elongation [m]."""
        return self._domain

    @property
    def reach(self) -> tuple[float, float]:
        """(lowest, highest) elongation [m] that a run can follow: `domain`, or a part of it."""
        return self._domain

    @property
    def force_model(self) -> str:
        """What a run computes the tension by."""
        return "exact"

    @property
    def parameters(self) -> dict[str, float]:
        """Numbers of the law's parameters, {name: float}."""
        names = (str(s) for s in self.law.parameters)
        return dict(zip(names, self.values.tolist(), strict=True))

    def energy(self, r: ArrayLike) -> Array:
        """Energy V [J] at elongations r [m] of any shape, the ends of the domain included."""
        return self._finite_derivative(0, r, closed=True)

    def tension(self, r: ArrayLike) -> Array:
        """Tension dV/dr at given elongations.

        Parameters
        ----------
        r : array_like, any shape
            Elongation from the (preloaded) equilibrium [m]; extension > 0.

        Returns
        -------
        ndarray, shape of r
            Force [N]; tension > 0.

        Raises
        ------
        LockingError
            If any r lies outside `domain`, or at an end of it.
        """
        return self._finite_derivative(1, r)

    def stiffness(self, r: ArrayLike) -> Array:
        """Tangent stiffness d2V/dr2 [N/m] at elongations r [m] of any shape."""
        return self._finite_derivative(2, r)

    def stiffness_slope(self, r: ArrayLike) -> Array:
        """Third derivative d3V/dr3 [N/m^2] at elongations r [m] of any shape."""
        return self._finite_derivative(3, r)

    def _finite_derivative(self, order: int, r: ArrayLike, closed: bool = False) -> Array:
        """A derivative of the energy, refused where the law gives no number."""
        found = self.derivative(order, r, closed)
        if np.isnan(found).any():
            at = float(np.asarray(r, dtype=float)[np.isnan(found)].flat[0])
            raise TensegrityError(f"{ORDERS[order]} at elongation {at:g} m is no number: it is nan")
        return found

    def derivative(self, order: int, r: ArrayLike, closed: bool = False) -> Array:
        """The order-th derivative of the energy, nan where its law is beyond all numbers; at an
        end of the domain if it counts as `closed`."""
        r = check.numbers("elongation", r, "m")
        low, high = self._domain
        inside = (r >= low) & (r <= high) if closed else (r > low) & (r < high)
        if not inside.all():
            worst = float(r[~inside].flat[0]) if r.ndim else float(r)
            raise self.beyond(worst)
        flat = np.ascontiguousarray(r).reshape(-1)
        return evaluated(self.law, order, self.values, flat).reshape(r.shape)

    @cached_property
    def openings(self) -> tuple[Kink, ...]:
        """Kinks of the force, as of contacts that open: place [m], strength, exponent and side
        of each, see `tensegrity.springs.kinks`."""
        law = self.law
        if not isinstance(law, Law) or isinstance(law, DerivedLaw):  # of prisms, fitted: smooth
            return ()
        return kinks(law.energy, law.elongation, law.parameters, self.values, self._domain)

    @property
    def smooth(self) -> bool:
        """Whether its derivatives do not jump anywhere."""
        return not self.openings

    def beyond(self, r: float) -> LockingError:
        """The error for an elongation at or beyond an end of the domain or of the reach."""
        side = int(r > 0)
        bound, way = self._domain[side], ("at or below", "at or above")[side]
        return LockingError(f"elongation {r:.6g} m is {way} {bound:.6g} m, where {self.ends[side]}")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Potential):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        if "_hash" not in self.__dict__:
            self._hash = hash(self._key())
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_hash"}  # of here

    def _key(self) -> Hashable:
        return self.law, self.values.tobytes(), self._length, self._domain

    def __repr__(self) -> str:
        if self.origin:
            return self.origin
        values = ", ".join(
            f"{name!r}: {number_text(value)}" for name, value in self.parameters.items()
        )
        length = "" if self._length is None else f", length={number_text(self._length)}"
        domain = ", ".join(map(number_text, self._domain))
        law = self.law
        return f"Potential({law.energy}, {law.elongation}, {{{values}}}{length}, domain=({domain}))"


def number_text(number: float) -> str:
    """The shortest text that reads back as this number: 1 rather than 1.0."""
    return repr(float(number)).removesuffix(".0")


def call(name: str, **given: Any) -> str:
    """The text of a call with these numbers, such as f(x=1, y=2)."""
    return f"{name}({', '.join(f'{key}={number_text(value)}' for key, value in given.items())})"


class PowerLaw(Potential):
    """Contact-like spring that pushes only: tension(r) = -stiffness max(-r, 0)^exponent.

    With a preload the elongation is measured from the precompressed equilibrium, and
    tension(r) = preload - stiffness max(r0 - r, 0)^exponent with r0 = (preload/stiffness)^(1/n).

    Parameters
    ----------
    stiffness : float
        [N/m^exponent], > 0.
    exponent : float
        n > 0; 3/2 is Hertz's contact of spheres.
    preload : float, optional
        Compressive force at rest [N], >= 0.
    length : float, optional
        Distance of the masses at r = 0 [m].

    Notes
    -----
    For n < 1 the stiffness has no bound where the contact opens: a run with a default step that
    opens it keeps its energy to about 1e-3 only; ask for a `tol`.  Without a preload contacts
    open at r = 0, where every motion starts: the stability limit goes to zero there, and a run
    costs absurdly many steps.

    Under a preload the energy is a small difference, V(r) = stored(r0 - r) - stored(r0) +
    preload r.  Near r = 0 it is lost in the round-off of stored(r0), which is stiffness
    r0^(n + 1)/(n + 1), and `energy_error` of a tiny motion is that round-off over its energy.
    The motion itself is not affected: it takes the tension, whose round-off is that of the preload.
    """

    def __init__(
        self, stiffness: float, exponent: float, preload: float = 0.0, length: float | None = None
    ) -> None:
        stiffness = check.number("stiffness", stiffness, above=0, unit="N/m^n")
        exponent = check.number("exponent", exponent, above=0)
        preload = check.number("preload", preload, least=0, unit="N")
        try:
            overlap = (preload / stiffness) ** (1 / exponent)
        except OverflowError:
            overlap = math.inf
        overlap = check.number("overlap under the preload", overlap, unit="m")
        values = [stiffness, preload, overlap]
        domain = (-math.inf, math.inf)
        self._set(DerivedLaw(_power_law, exponent), values, length, domain)
        self._exponent = exponent
        self.openings = ((overlap, stiffness, exponent, -1.0),)
        given: dict[str, Any] = {"stiffness": stiffness, "exponent": exponent, "preload": preload}
        given |= {} if length is None else {"length": self._length}
        self.origin = call("PowerLaw", **given)

    @property
    def exponent(self) -> float:
        """n."""
        return self._exponent

    def _with(self, parameters: dict[str, float]) -> PowerLaw:
        stiffness, preload = parameters["stiffness"], parameters["preload"]
        return PowerLaw(stiffness, self._exponent, preload, self._length)

    def shift_from(self, other: Potential) -> float:
        """As that of `Potential`: by how much more it is pressed together at rest."""
        return float(self.values[2] - other.values[2])


def _power_law(exponent: float) -> Law:
    import sympy as sp

    from derivations import contact as derived

    r = sp.Symbol("r", real=True)
    stiffness, preload, overlap = sp.symbols("stiffness preload overlap", real=True)
    n = sp.nsimplify(exponent, rational=True)
    # The power never sees 0, where its higher derivatives are infinite: 0 times inf is no number.
    closed, gap = sp.Heaviside(overlap - r - SMALLEST), sp.Symbol("gap")
    pressed = sp.Max(overlap - r, SMALLEST)

    def stored(gap: sp.Expr) -> sp.Expr:
        known = {derived.constant: stiffness, derived.exponent: n, derived.overlap: gap}
        return derived.power_law_energy().subs(known)

    energy = closed * stored(pressed) - stored(overlap) + preload * r
    # while the contact is closed; told of the maximum, differentiation would divide to choose
    tension = preload - closed * sp.diff(stored(gap), gap).subs(gap, pressed)
    return Law(energy, r, (stiffness, preload, overlap), tension)
