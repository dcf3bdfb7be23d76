"""A unit of a user's own, described by lengths of members and energies in SymPy.

A unit has inner coordinates and one that is controlled, such as its height.  Its members are
springs, bars and strings whose lengths are expressions of the coordinates; rigid ones have the
spring constant inf.  Further energies, such as those of hinges, are added.  Natural lengths follow
from the state at rest and the prestrain of some members.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import fixed
from tensegrity.unit import rest as at_rest
from tensegrity.unit.member import Member, by_symbol, expression, expressions, mapping

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tensegrity.branches.table import Event
    from tensegrity.springs.pair_law import PairLaw
    from tensegrity.unit.formula import Formula
    from tensegrity.unit.path import UnitProblem
    from tensegrity.unit.potential import UnitPotential


@dataclass(frozen=True, eq=False, repr=False)
class Unit(Printed):
    """A unit that one coordinate compresses, the others being in equilibrium.

    Parameters
    ----------
    inner : sequence of sympy.Symbol
        Coordinates in equilibrium, such as a twist.
    control : sympy.Symbol
        The coordinate that is given, such as the height [m]; its load counts compression.
    members : sequence of Member, optional
    energy : sympy.Expr, optional
        Further energy [J], such as that of hinges.
    parameters : dict, optional
        Values of other symbols: {Symbol or its name: float}.  A symbol without value stays one in
        formulas; where a number is wanted, it is refused.
    rest : dict
        Coordinates of a state in equilibrium without load: {Symbol or its name: value}.
    prestrain : dict, optional
        {Member: strain at rest, (L - N)/N, N the natural length}.  Tensions of members with neither
        prestrain nor natural length follow from equilibrium.
    events : dict, optional
        {name: expression of the coordinates that vanishes there}, for `equilibrium_path`.

    Raises
    ------
    EquilibriumError
        The rest is no equilibrium, there is no self-stress, or it is not determined.
    TensegrityError
        Other arguments that are not as described.

    Examples
    --------
    A cross of two bars between cables, of which two are prestrained:

    >>> import sympy as sp
    >>> from tensegrity import Member, Unit, equilibrium_path
    >>> w, h = sp.symbols("w h", positive=True)
    >>> cables, verticals = Member(w, 1.0, 2, string=True), Member(h, 2.0, 2, string=True)
    >>> bars = Member(sp.sqrt(w**2 + h**2), 50.0, 2)
    >>> rest, members = {w: 1.0, h: 0.75}, [cables, verticals, bars]
    >>> unit = Unit([w], h, members, rest=rest, prestrain={cables: 0.1})
    >>> print(round(unit.axial_stiffness(), 11))
    4.81270681668
    >>> path = equilibrium_path(unit, min_height=0.4)
    >>> print([(e.kind, round(e.load, 6)) for e in path.events])
    [('slack', 0.160714), ('fold', 0.206994)]
    """

    inner: Any
    control: Any
    members: Any = ()
    energy: Any = 0
    parameters: Any = field(default_factory=dict)
    rest: Any = None
    prestrain: Any = field(default_factory=dict)
    events: Any = field(default_factory=dict)

    def __post_init__(self) -> None:
        import sympy as sp

        given: dict[str, Any] = self.__dict__
        inner = check.sequence("inner", self.inner, "symbols")
        for name, one in (*(("inner", x) for x in inner), ("control", self.control)):
            if not isinstance(one, sp.Symbol):
                raise TensegrityError(f"{name} {check.shown(one)} is not a SymPy symbol")
        if len({str(x) for x in (*inner, self.control)}) <= len(inner):
            raise TensegrityError(f"inner {check.shown(inner)} and control must be different names")
        members = check.sequence("members", self.members, "Member")
        for one in members:
            check.kind("member", one, Member)
        given |= {"inner": inner, "members": members}
        given["energy"] = expression("energy", self.energy)
        given["events"] = fixed(expressions("events", self.events))
        self._check_coordinates()
        symbols = {str(x): x for x in self._symbols}
        for name in ("parameters", "rest"):
            given[name] = fixed(by_symbol(name, given[name], symbols, self.coordinates))
        prestrain = mapping("prestrain", self.prestrain)
        for one in prestrain:
            if one not in members:
                raise TensegrityError(f"prestrain of {check.shown(one)}, which is not a member")
        strains = {m: expression("prestrain", x) for m, x in prestrain.items()}
        given["prestrain"] = fixed(strains)
        if not self.open_symbols:
            at_rest.at_rest(self)
            self._check_natural()

    def _check_coordinates(self) -> None:
        known = set().union(
            *(m.length.free_symbols for m in self.members), self.energy.free_symbols
        )
        for q in self.coordinates:
            if q not in known:
                raise TensegrityError(f"coordinate {q} is in no length of a member and no energy")

    def _check_natural(self) -> None:
        for member, natural in zip(self.members, self.natural_lengths(), strict=True):
            if member.natural is None and not natural > 0 and member.string:
                raise TensegrityError(
                    f"natural length {natural:g} m of the string {member.length} must be above 0"
                )

    @property
    def coordinates(self) -> tuple[Any, ...]:
        """Inner coordinates, then the controlled one."""
        return (*self.inner, self.control)

    @property
    def _symbols(self) -> set[Any]:
        members = ((m.length, m.k, m.count, m.natural) for m in self.members)
        given = [self.energy, *(x for one in members for x in one), *self.events.values()]
        for several in (self.rest, self.prestrain):
            given += several.values() if isinstance(several, Mapping) else ()
        symbols = (x.free_symbols for x in given if hasattr(x, "free_symbols"))
        return set().union(*symbols, self.coordinates)

    @property
    def open_symbols(self) -> tuple[Any, ...]:
        """Symbols that have no value."""
        known = {*self.coordinates, *self.parameters}
        return tuple(sorted(self._symbols - known, key=str))

    def self_stress(self) -> list[float]:
        """Tension of one of each of the members at rest [N].

        Returns
        -------
        list of float
            In the order of the members; below 0 in compression.
        """
        return [float(x) for x in at_rest.at_rest(self).tensions]

    def natural_lengths(self) -> list[float]:
        """Natural length of each of the members [m], in their order."""
        of = at_rest.at_rest(self)
        each = zip(of.lengths, of.tensions, of.stiffness, strict=True)
        return [float(length - tension / k) for length, tension, k in each]

    def axial_stiffness(self, at: Any = None) -> float:
        """Stiffness of the controlled coordinate, the inner ones being in equilibrium [N/m].

        Parameters
        ----------
        at : Event or dict of str to float, optional
            A state of `equilibria`, or its coordinates; by default the rest.

        Returns
        -------
        float
            Correct to the last digit for exact values of the arguments.

        Raises
        ------
        TensegrityError
            A symbol has no value, the state is no equilibrium, or the inner coordinates have a
            motion without stiffness.
        """
        of = self if at is None else self.about(at)
        return float(at_rest.condensed_stiffness(of))

    def about(self, state: Any) -> Unit:
        """The same unit with another unloaded state as its rest.

        Parameters
        ----------
        state : Event or dict
            A state of `equilibria`, or its coordinates: {Symbol or its name: float}.

        Raises
        ------
        TensegrityError
            It is no equilibrium, or lacks a coordinate.
        """
        import mpmath

        given = getattr(state, "at", state)
        known = {str(name): x for name, x in mapping("at", given).items()}
        missing = [str(q) for q in self.coordinates if str(q) not in known]
        if missing:
            raise TensegrityError(f"at {check.shown(given)} lacks the coordinate {missing[0]}")
        of = at_rest.at_rest(self)
        exact = zip(self.members, of.lengths, of.tensions, of.stiffness, strict=True)
        with mpmath.workdps(at_rest.DIGITS):
            members = [
                replace(m, natural=at_rest.as_rational(length - tension / k))
                for m, length, tension, k in exact
            ]
        state = {q: known[str(q)] for q in self.coordinates}
        return replace(self, members=members, rest=state, prestrain={})

    def equilibria(self, box: Mapping[Any, Any] | None = None) -> tuple[Event, ...]:
        """Unloaded states, stable or not, that are found in a box of coordinates.

        Newton's method starts from many points of the box; one of a small basin may be missed.

        Parameters
        ----------
        box : dict, optional
            {Symbol or its name: (lowest, highest)}.  By default an angle between 0 and pi at rest
            stays there, and another is within pi of the rest.  Another coordinate has up to twice
            its size at rest, of both signs, or above 0 if its symbol is positive or its sign
            changes no length and no energy.

        Returns
        -------
        tuple of Event
            From the largest value of the controlled coordinate down.  Each has the coordinates, the
            `energy` [J] above that of the rest, and `stable`, of all coordinates without load.

        Raises
        ------
        TensegrityError
            A symbol has no value, or the box is not as described.
        """
        from tensegrity.unit.states import equilibria

        return equilibria(self, None if box is None else mapping("box", box))

    def formula(self, name: str) -> Formula:
        """A closed form in the symbols of the unit, those with values included.

        Parameters
        ----------
        name : str
            "axial stiffness" of the controlled coordinate at rest [N/m], or "tension_0", ..,
            "natural_length_0", .. of the members [N], [m].

        Returns
        -------
        Formula
            Its `expression` has long parts replaced by symbols that `where` defines.

        Raises
        ------
        TensegrityError
            Another name, no self-stress, a motion without stiffness, or a formula that is too long
            while a symbol has no value.

        Examples
        --------
        Two rigid bars across a square of cables, of which two have the prestrain p:

        >>> import sympy as sp
        >>> from tensegrity import Member, Unit
        >>> k, p, w, h = sp.symbols("k p w h", positive=True)
        >>> cable, post = Member(w, k, 2), Member(h, k, 2)
        >>> bar = Member(sp.sqrt(w**2 + h**2), sp.oo, 2)
        >>> unit = Unit([w], h, [cable, post, bar], rest={w: 1, h: 1}, prestrain={cable: p})
        >>> print(unit.formula("axial stiffness").expression)
        4*k/(p + 1)
        """
        from tensegrity.unit.formula import formula

        return formula(self, check.kind("name", name, str))

    def argument(self) -> list[Any]:
        """Compatibility, equilibrium, self-stress, stiffness and its limits, each a sentence with
        formulas: `python -m derivations unit FILE` makes a page of them."""
        from tensegrity.unit.formula import argument

        return argument(self)

    @checked
    def problem(
        self,
        *,
        min_height: float | None = None,
        max_load: Annotated[float, "> 0", "or inf", "N"] = math.inf,
        max_height: float | None = None,
    ) -> UnitProblem:
        """The problem whose path `equilibrium_path` follows, with the same arguments.

        Parameters
        ----------
        min_height : float, optional
            Value of the controlled coordinate at which the path ends; by default 0 if the rest is
            above it, else none.
        max_load : float, optional
            Load at which the path ends [N], compression > 0.
        max_height : float, optional
            Value up to which the tension side is included; by default it is not.

        Returns
        -------
        UnitProblem
            Its path has the columns of the coordinates, "load", "energy" and "tension_0", ..

        Raises
        ------
        TensegrityError
            An argument is outside its bounds, or a symbol has no value.
        """
        from tensegrity.unit.path import unit_problem

        return unit_problem(self, min_height, max_load, max_height)

    def potential(self, preload: float = 0.0, at: Any = None) -> UnitPotential:
        """Potential of the controlled coordinate, for use as a spring of a chain.

        Parameters
        ----------
        preload : float, optional
            Load at rest [N], compression > 0.
        at : Event or dict, optional
            An unloaded state of `equilibria`, or its coordinates, in place of the rest.

        Returns
        -------
        UnitPotential
            V(0) = V'(0) = 0.  `gradient(..).by(name)` has derivatives by the parameters of the unit
            that have a symbol, at constant preload, and by a preload above 0.

        Raises
        ------
        EquilibriumError
            No equilibrium before the first limit point carries the preload.
        TensegrityError
            A symbol has no value, or the inner coordinates have a motion without stiffness.
        """
        from tensegrity.unit.potential import unit_potential

        return unit_potential(self, preload, at)

    def pair(self, sites: Sequence[Any]) -> PairLaw:
        """Pair law of sites whose coordinates differ by some of the unit's, for chains or networks.

        Parameters
        ----------
        sites : sequence of sympy.Symbol or str
            One to three coordinates, inner or controlled; the others are in equilibrium.

        Returns
        -------
        PairLaw
            Of its members as springs, all coordinates free; parameters act at constant natural
            lengths.  Where Newton's method from the rest finds no equilibrium, it has no value.

        Raises
        ------
        TensegrityError
            A symbol has no value, a name is no coordinate, or a member is rigid or a string.
        """
        from tensegrity.unit.potential import unit_pair

        return unit_pair(self, sites)

    @property
    def contents(self) -> str:
        """Digest of what it describes, which equal units have in common."""
        import sympy as sp

        if "_made" not in self.__dict__:
            parts: list[Any] = [self.inner, self.control, self.energy, self.members]
            parts += [sorted(getattr(self, x).items(), key=str) for x in ("parameters", "rest")]
            parts += [[*self.prestrain.items()], [*self.events.items()]]
            text = sp.srepr([[(m.length, m.k, m.count, m.natural or sp.nan, m.string)
                              for m in self.members], *parts[:3]]) + repr(parts[3:])  # fmt: skip
            self.__dict__["_made"] = hashlib.sha256(text.encode()).hexdigest()
        return str(self.__dict__["_made"])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Unit) and self.contents == other.contents

    def __hash__(self) -> int:
        return hash(self.contents)

    def _lines(self) -> Lines:
        inner = ", ".join(map(str, self.inner)) or "no coordinate"
        yield f"unit with {self.control} given, {inner} in equilibrium"
        for k, m in enumerate(self.members):
            kind = "string" if m.string else "member"
            strain = f", prestrain {_text(self.prestrain[m])}" if m in self.prestrain else ""
            yield f"  {kind} {k}: {m.count} of length {m.length}, k {_text(m.k)}{strain}"
        if self.energy != 0:
            yield f"  further energy: {self.energy}"
        for name in ("rest", "parameters", "events"):
            if given := getattr(self, name):
                values = (f"{x} = {_text(value)}" for x, value in given.items())
                yield f"  {name}: {', '.join(values)}"

    def __repr__(self) -> str:
        count, names = len(self.members), ", ".join(map(str, self.coordinates))
        return f"Unit({count} member{'s' * (count != 1)}, coordinates {names}, {self.contents[:8]})"


def _text(value: Any) -> str:
    return f"{float(value):.6g}" if value.is_number else str(value)
