"""Units as springs: potentials, the energy against the elongation of the controlled coordinate, and
pair laws of sites to which some of the coordinates belong, as differences.

The other coordinates are in equilibrium bond by bond.  In potentials, angles enter by the tangents
of half their changes, so that the law is algebraic where lengths are.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.springs.pair_law import PairLaw, pair_with_inner
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.unit import rest as at_rest
from tensegrity.unit.condensed import CondensedPotential
from tensegrity.unit.forms import Mixed, exact_numbers, mixed, numbers
from tensegrity.unit.law import CondensedLaw
from tensegrity.unit.path import equations
from tensegrity.unit.states import box_of

REACH = 5.0  # changes of the controlled coordinate, over its size at rest
MOVED = 1e-15  # relative change of a parameter, for a derivative in 40 digits


class UnitLaw(CondensedLaw):
    """Law of a unit."""

    def mixed(self) -> Mixed:
        """See `CondensedLaw.mixed`."""
        return mixed(self.of, (self.of.control,), True)


class UnitPotential(CondensedPotential):
    """Potential of a unit, the inner coordinates of which are in equilibrium.

    Parameters
    ----------
    unit : Unit
    preload : float
        Load at rest [N], compression > 0.
    given, state : Unit, dict of str to float
        The unit before another state became its rest, and that state.

    Attributes
    ----------
    made_of : tuple
        The unit as it was given, the preload, and the state or None.

    Notes
    -----
    The domain ends where a string goes slack, where equilibrium at given elongation is lost or
    becomes unstable, or where the controlled coordinate has changed by five times its size.
    """

    def __init__(self, unit: Any, preload: float, given: Any, state: Any) -> None:
        at_rest.check_inner(unit)
        self._unit, self._preload, self.made_of = unit, preload, (given, preload, state)
        self._p, self._scale = numbers(unit), np.array(self._problem.scale)
        start = at_rest.coordinates(unit)[-1]
        self._origin = self._described = f"{unit!r}.potential(preload={preload:g})"
        strings = [x for x in self._problem.events if x.startswith("string ")]
        name, (low, high) = f"change of {unit.control}", box_of(unit, reach=REACH)[-1]
        self._follow(("turn", *strings), ("turn", *strings), {name: low - start},
                     {name: high - start})  # fmt: skip
        self._measure(start)

    def _beyond(self, path: Any) -> str:
        where = f"is beyond {path.load[-1]:g} N, where the path of the unit ends"
        return f"{where}: {path.end}"

    def _reason(self, end: str) -> str:
        if end.startswith("string "):
            member = self._unit.members[int(end.split()[1])]
            return f"the string {member.length} goes slack"
        return f"{self._unit.control} leaves the range that is computed"

    @property
    def _problem(self) -> Any:
        return equations(self._unit, True)

    def _law(self, steps: int) -> UnitLaw:
        return UnitLaw(self._unit, steps)

    def _part(self) -> Any:
        low, high = self._domain
        parts = (self._widest(lambda x, y=y, z=z: (low * x**y, high * x**z))
                 for y, z in ((1, 0), (0, 1), (1, 1)))  # fmt: skip
        found = [part for part in parts if part]
        return max(found, key=lambda part: -part[2][0] * part[2][1], default=None)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of the unit, and the preload, {name: float}."""
        of = self.made_of[0].parameters
        return {str(x): float(value) for x, value in of.items()} | {"preload": self._preload}

    def _with(self, parameters: dict[str, float]) -> Potential:
        unit, _, state = self.made_of
        given = {x: parameters[str(x)] for x in unit.parameters}
        others = {x: y if float(y) == given[x] else given[x] for x, y in unit.parameters.items()}
        return replace(unit, parameters=others).potential(parameters["preload"], state)

    def _rates_by(self, name: str) -> tuple[Sequence[float], Array]:
        """By differences in multiple precision, about the same state."""
        import sympy as sp

        unit, _, state = self.made_of
        if name == "preload":
            return (0.0, 0.0, 1.0), np.zeros(len(self._p))
        (symbol,) = (x for x in unit.parameters if str(x) == name)
        value = at_rest.as_rational(at_rest.values(unit, [symbol])[0])
        step = (abs(value) or sp.Integer(1)) * sp.Rational(MOVED)
        ends = []
        for x in (-step, step):
            moved = replace(unit, parameters={**unit.parameters, symbol: value + x})
            ends.append(exact_numbers(moved if state is None else moved.about(state)))
        change = at_rest.number(2 * step)
        by_p = [float((b - a) / change) for a, b in zip(*ends, strict=True)]
        return (0.0, 0.0, 0.0), np.array(by_p)

    def _shift_from(self, other: Potential) -> float:
        return float(self.length or 0.0) - float(other.length or 0.0)

    def _key(self) -> Hashable:
        unit, preload, state = self.made_of
        return "unit", unit, preload, None if state is None else tuple(state.items())


def unit_potential(unit: Any, preload: float, at: Any) -> UnitPotential:
    """The potential of a unit.

    Parameters
    ----------
    unit, preload, at
        See `Unit.potential`.

    Returns
    -------
    UnitPotential
    """
    about = unit if at is None else unit.about(at)
    state = None if at is None else {str(q): float(x) for q, x in about.rest.items()}
    return UnitPotential(about, check.number("preload", preload, unit="N"), unit, state)


def unit_pair(unit: Any, sites: Any) -> PairLaw:
    """The pair law of a unit.

    Parameters
    ----------
    unit, sites
        See `Unit.pair`.

    Returns
    -------
    PairLaw
    """
    import sympy as sp

    if unit.open_symbols:
        raise TensegrityError(f"no value for {unit.open_symbols[0]}: a pair law needs numbers")
    names = {str(q): q for q in unit.coordinates}
    chosen = [str(x) for x in check.sequence("sites", sites, "coordinates")]
    for name in chosen:
        if name not in names or chosen.count(name) > 1:
            raise TensegrityError(f"sites {chosen}: each must be one of {', '.join(names)}, once")
    of, rest = at_rest.at_rest(unit), {q: sp.Float(float(x)) for q, x in unit.rest.items()}
    first, second = ([sp.Symbol(f"{x}_{end}", real=True) for x in chosen] for end in "ij")
    inner = [q for q in unit.coordinates if str(q) not in chosen]
    unknowns = [sp.Symbol(f"change of {q}", real=True) for q in inner]
    moves = {names[x]: b - a for x, a, b in zip(chosen, first, second, strict=True)}
    moves |= dict(zip(inner, unknowns, strict=True))
    moved = {q: rest[q] + x for q, x in moves.items()}
    whole = unit.energy.xreplace(moved) - unit.energy.xreplace(rest)
    for member, length, tension, k in zip(unit.members, of.lengths, of.tensions, of.stiffness,
                                          strict=True):  # fmt: skip
        if k == float("inf"):
            raise TensegrityError(f"member {member.length} is rigid: a pair law needs a finite k")
        if member.string:
            raise TensegrityError(
                f"string {member.length} may slacken: a pair law needs springs, string=False"
            )
        natural, start = sp.Float(float(length - tension / k)), float(tension) ** 2 / float(2 * k)
        stretch = member.length.xreplace(moved) - natural
        whole += member.count * (member.k * stretch**2 / 2 - sp.Float(start))
    parameters = {p: x for p, x in unit.parameters.items() if whole.has(p)}
    return pair_with_inner(whole, first, second, parameters, unknowns)
