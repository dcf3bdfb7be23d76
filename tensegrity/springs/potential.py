"""Scalar potentials of a bond: energy, tension and stiffness against elongation.

A potential is a law (what is compiled) with numbers for its parameters, measured from its
equilibrium under the preload: V(0) = V'(0) = 0.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.law import DerivedLaw, Law
from tensegrity.engine.programs import derived, run
from tensegrity.errors import LockingError, TensegrityError
from tensegrity.printing import concise, number_text
from tensegrity.readonly import fixed
from tensegrity.springs.kinks import kinks
from tensegrity.springs.spline import KINDS, SplineLaw, from_table
from tensegrity.springs.varied import OverTime, varied
from tensegrity.springs.written import written
from tensegrity.typing import Length, Mass

if TYPE_CHECKING:
    from collections.abc import Hashable

    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.springs.kinks import Kink
    from tensegrity.typing import Array

ORDERS = ("energy", "tension", "stiffness", "slope of the stiffness")


class Potential:
    """Energy of a spring as a function of its elongation.

    Parameters
    ----------
    energy : sympy.Expr
        V(r) [J] of `elongation` and `parameters`; a chain is in equilibrium at r = 0 if V'(0) = 0.
    elongation : sympy.Symbol
        r [m], extension > 0.
    parameters : dict, optional
        Values of the other symbols of `energy`: {Symbol or its name: float}.  Chains that differ
        only in these values share one compiled kernel.
    length : float, optional
        Length [m] at r = 0: the lattice spacing, to which strains refer.
    domain : (float, float), optional
        Lowest and highest admissible elongation [m], one below and one above 0.

    Raises
    ------
    TensegrityError
        Arguments that are not as described, or parameters that do not match the energy's symbols.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Potential
    >>> r, k = sp.symbols("r k")
    >>> toda = Potential(k * (sp.exp(-r) + r - 1), r, {k: 2.0})
    >>> toda.tension([-0.1, 0.0, 0.1]).round(4)
    array([-0.2103,  0.    ,  0.1903])
    """

    noise = 0.0  # standard deviation that was smoothed away from a table [N]
    _origin = ""  # the call that made this potential, unless it is that of its class
    _made_of: Any = None  # the prism and the preload of a prism's potential
    _varied: tuple[str, ...] = ()  # parameters that may change, if not all
    _numbers: tuple[Any, ...] = ()  # of the energy, for which the law's last parameters stand

    def __init__(
        self,
        energy: sp.Expr | float,
        elongation: sp.Symbol,
        parameters: Mapping[Any, float] | None = None,
        length: float | None = None,
        domain: tuple[float, float] = (-math.inf, math.inf),
    ) -> None:
        law, values, self._numbers = written(energy, elongation, parameters)
        self._set(law, values, length, domain)

    def _set(
        self,
        law: Any,
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
            raise TensegrityError(f"domain {check.shown(domain)} must be two elongations")
        low, high = (check.number("domain end", x, finite=False) for x in ends_of_it)
        if not low < 0 < high:
            raise TensegrityError(f"domain ({low:g}, {high:g}) m must contain 0 m inside")
        self._domain = low, high
        self.ends = ends

    @classmethod
    @checked
    def from_table(
        cls,
        elongation: ArrayLike | str | os.PathLike[str],
        tension: ArrayLike | None,
        kind: Annotated[str, KINDS] = "cubic",
        *,
        noise: Annotated[float, "> 0", "N"] | None = None,
        preload: Annotated[float, "N"] | None = None,
        extrapolate: bool = False,
        length: Length | None = None,
    ) -> Potential:
        """A spring from measured tensions.

        Parameters
        ----------
        elongation : array_like, (points,), or path
            Sorted, each once, with 0 inside [m]; at most 100, or 100,000 of a "smooth" table.  Or
            a text file whose first columns are elongation [m] and tension [N].
        tension : array_like, (points,), or None with a file
            [N], > 0 in extension.
        kind : {"cubic", "monotone", "linear", "smooth"}, optional
            The tension between the points: the not-a-knot cubic spline (from 4 points), that of
            Fritsch and Carlson, monotone where the points are (3), lines (2), or a cubic spline
            without the noise (5).
        noise : float, optional
            Standard deviation of the tensions of a "smooth" table [N]; estimated by default.
        preload : float, optional
            Compressive force at rest [N]: elongations are then measured from the point nearest to 0
            with the tension -preload, and the tension from there.  By default those of the table
            remain, with an equilibrium at 0 only if the tension is 0 there.
        extrapolate : bool, optional
            Continue by tangents beyond the table, where by default the domain ends.
        length : float, optional
            Length at the elongation 0 of the table [m].

        Returns
        -------
        Potential
            V(0) = 0; its `noise` is the standard deviation that was smoothed away [N].

        Raises
        ------
        TensegrityError
            Points that are not as described, no such preload, or noise of another kind; spacings so
            unequal, or steps so steep, that the spline misses the points (`ResolutionError`).

        Examples
        --------
        >>> import numpy as np
        >>> from tensegrity import Potential
        >>> r = np.linspace(-1, 1, 21)
        >>> spring = Potential.from_table(r, r + 0.5 * r**2 + 0.2 * r**3)
        >>> print(spring.stiffness(0.0).round(12), spring.energy(0.5).round(12))
        1.0 0.148958333333
        """
        given = elongation, tension, kind, noise, preload, extrapolate, length
        law, values, length, domain, left, origin = from_table(*given)
        made = Potential.__new__(Potential)
        made._set(law, values, length, domain, ("the table ends",) * 2)
        made.noise, made._origin = left, origin
        return made

    def varied(self, values: Mapping[str, float]) -> Potential:
        """The same spring with other values of its arguments.

        Parameters
        ----------
        values : dict of str to float
            Parameters, or arguments of the prism and the preload: {name: value}.

        Raises
        ------
        TensegrityError
            The spring has no such argument, or the value is not admissible.
        """
        return varied(self, values)

    def over_time(self, **arguments: sp.Expr | float) -> Potential:
        """The same spring with arguments that change with time, for chains and networks.

        Parameters
        ----------
        **arguments
            Expressions of `t` [s] of arguments that `varied` takes, such as a prism's prestrain.

        Returns
        -------
        Potential
            Which has an energy at an instant only, `at(t)`.  Its change does work at the rate
            dV/dt at fixed elongation, from the shape at t = 0.  Each bond may have its own.

        Raises
        ------
        TensegrityError
            No such argument, another symbol than t, or a value at t = 0 that is not admissible.
        """
        law, made = OverTime(self, arguments), Potential.__new__(Potential)
        made._set(law, (), law.start.length, law.start.domain)
        made._origin = repr(law)
        return made

    def at(self, t: float) -> Potential:
        """The spring at time t [s]; itself, unless it changes `over_time`."""
        t, at = check.number("t", t, unit="s"), getattr(self.law, "at", None)
        return at(t) if at else self

    def _with(self, parameters: dict[str, float]) -> Potential:
        other = copy(self)
        for name in ("_hash", "kinks"):
            other.__dict__.pop(name, None)
        values = [check.number(f"parameter {name}", x) for name, x in parameters.items()]
        other.values = fixed(np.array([*values, *self.values[len(values) :]]))
        return other

    def _shift_from(self, other: Potential) -> float:
        """Elongation [m] of this spring where that of `other`, from which it was varied, is 0:
        prisms and contacts are measured from an equilibrium that depends on their arguments."""
        return float(other.length or 0.0) - float(self.length or 0.0) if self._made_of else 0.0

    @property
    def length(self) -> float | None:
        """Length at r = 0 [m], or None if it was not given."""
        return self._length

    @property
    def domain(self) -> tuple[float, float]:
        """(lowest, highest) elongation [m]."""
        return self._domain

    @property
    def computable_domain(self) -> tuple[float, float]:
        """(lowest, highest) elongation [m] in a run: `domain`, or the part that can be computed."""
        return self._domain

    @property
    def force_model(self) -> str:
        """The model by which a run computes the tension, such as "exact"."""
        return "exact"

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the law's parameters, {name: float}."""
        given = len(self.values) - len(self._numbers)
        names = (str(s) for s in self.law.parameters[:given])
        return dict(zip(names, self.values[:given].tolist(), strict=True))

    @property
    def numbers(self) -> Array:
        """Values of the numbers of the energy, the last parameters of the law, (numbers,)."""
        return self.values[len(self.values) - len(self._numbers) :]

    @property
    def expression(self) -> sp.Expr:
        """The energy as a SymPy expression of `law.elongation` and the `parameters`."""
        import sympy as sp

        if not getattr(self.law, "is_expression", False):
            raise TensegrityError(f"{check.shown(self)} is no expression")
        constants = self.law.parameters[len(self.law.parameters) - len(self._numbers) :]
        numbers = map(sp.sympify, self._numbers)
        return self.law.energy.xreplace(dict(zip(constants, numbers, strict=True)))

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
        """A derivative of the energy, refused if it is nan."""
        values = self.derivative(order, r, closed)
        if np.isnan(values).any():
            at = float(np.asarray(r, dtype=float)[np.isnan(values)].flat[0])
            raise TensegrityError(f"{ORDERS[order]} at elongation {at:g} m is not a number")
        return values

    def derivative(self, order: int, r: ArrayLike, closed: bool = False) -> Array:
        """A derivative of the energy.

        Parameters
        ----------
        order : int
            0 to 3: energy [J], tension [N], stiffness [N/m], its slope [N/m^2].
        r, closed : array_like, bool
            Elongation [m], > 0 in extension; the ends of the domain are admissible if `closed`.

        Returns
        -------
        ndarray, shape of r; nan where the law overflows

        Raises
        ------
        LockingError
            Some r lies outside the domain.
        """
        r = check.numbers("elongation", r, "m")
        low, high = self._domain
        inside = (r >= low) & (r <= high) if closed else (r > low) & (r < high)
        if not inside.all():
            raise self._range_error(float(r[~inside].flat[0]))
        flat = np.ascontiguousarray(r).reshape(-1)
        return evaluated(self.law, order, self.values, flat).reshape(r.shape)

    @cached_property
    def kinks(self) -> tuple[Kink, ...]:
        """Kinks of the force, such as losses of contact: place [m], strength, exponent and side
        of each; see `tensegrity.springs.kinks`."""
        law = self.law
        if isinstance(law, SplineLaw):
            return law.kinks(self.values, self._domain)
        if not isinstance(law, Law) or isinstance(law, DerivedLaw):  # smooth: prisms, polynomials
            return ()
        values = [*self.parameters.values(), *self._numbers]
        return kinks(law.energy, law.elongation, law.parameters, values, self._domain)

    @property
    def smooth(self) -> bool:
        """Whether the force has no kinks."""
        return not self.kinks

    @checked
    def sound_speed(self, mass: Mass = 1.0) -> float:
        """Speed of long waves of small amplitude in a chain of these springs.

        Parameters
        ----------
        mass : float, optional
            Of each site [kg], > 0.

        Returns
        -------
        float
            sqrt(V''(0)/m), in sites per second; 0 in a sonic vacuum.

        Raises
        ------
        TensegrityError
            A spring that softens at rest, V''(0) < 0.
        """
        stiffness = float(self.stiffness(0.0))
        if stiffness < 0:
            raise TensegrityError(f"stiffness {stiffness:g} N/m at rest must be at least 0")
        return math.sqrt(run(derived(_sound_speed_squared), np, (stiffness, mass))[0])

    def to_c(self, path: str | os.PathLike[str]) -> Path:
        """Write this spring as a C file that stands alone.

        Parameters
        ----------
        path : str or path
            The name without its ending begins the names in the file: `spring.c` defines, of an
            elongation r [m] between ``spring_lowest`` and ``spring_highest``, extension > 0, the
            functions ``double spring_energy(double r)`` [J], ``spring_tension`` [N] and
            ``spring_stiffness`` [N/m], equal to those in Python to round-off, of elastic prisms to
            1e-14 of the inner unknowns.  With ``-DDRIVER`` it is a program that prints them.

        Returns
        -------
        Path

        Raises
        ------
        TensegrityError
            If `path` names no file, or the file cannot be written.
        EquilibriumError
            A prism with elastic members whose inner unknowns few iterations do not find.
        """
        from tensegrity.springs.export import to_c

        return to_c(self, path)

    def _range_error(self, r: float) -> LockingError:
        """The error for an elongation at or beyond an end of either domain."""
        side = int(r > 0)
        bound, way = self._domain[side], ("at or below", "at or above")[side]
        return LockingError(f"elongation {r:.6g} m is {way} {bound:.6g} m, where {self.ends[side]}")

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if isinstance(other, Potential) else NotImplemented

    def __hash__(self) -> int:
        if "_hash" not in self.__dict__:
            self._hash = hash(self._key())
        return self._hash

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_hash"}  # per process

    def _key(self) -> Hashable:
        return self.law, self.values.tobytes(), self._length, self._domain

    __str__ = concise

    def __repr__(self) -> str:
        if self._origin:
            return self._origin
        values = ", ".join(f"{x!r}: {number_text(y)}" for x, y in self.parameters.items())
        length = "" if self._length is None else f", length={number_text(self._length)}"
        domain = ", ".join(map(number_text, self._domain))
        energy = f"{self.expression}, {self.law.elongation}"
        return f"Potential({energy}, {{{values}}}{length}, domain=({domain}))"


def _sound_speed_squared() -> tuple[list[Any], tuple[Any, ...]]:
    """Square of the speed in sites in terms of stiffness and mass."""
    from derivations import waves as form

    squared = form.sound_speed().subs(form.spacing, 1) ** 2
    return [squared], (form.stiffness, form.mass)
