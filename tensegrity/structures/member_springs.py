"""The springs of bars and strings, and the network of a structure in motion.

Elongations are measured from the natural length, of a member whose natural length changes from
that of the structure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.law import Law
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.scenes.network import Network
from tensegrity.springs.kinks import TAUT, Kink
from tensegrity.springs.potential import Potential
from tensegrity.typing import Length, Stiffness

SMALLEST = 1e-100  # elongation above which a string has tension [m]
UNBOUNDED = -math.inf, math.inf


@checked
class _Member(Potential):
    tension_only = False

    def __init__(self, stiffness: Stiffness, length: Length) -> None:
        values = [stiffness, TAUT * length] if self.tension_only else [stiffness]
        self._set(_law(self.tension_only), values, length, UNBOUNDED)
        self.kinks = ((0.0, stiffness, 1.0, 1.0),) if self.tension_only else ()
        self._origin = call(type(self).__name__, stiffness=stiffness, length=length)


class StringSpring(_Member):
    """A string with tension(r) = stiffness max(r, 0), stiffness > 0 [N/m].

    The elongation r [m] is measured from the natural length > 0 [m].  Down to -`TAUT` times this
    length the stiffness is that of a taut string, as in `tensegrity.structures.members`.
    """

    tension_only = True


class BarSpring(_Member):
    """A bar with tension(r) = stiffness r; r [m] is measured from the natural length > 0 [m]."""


class BucklingBar(Potential):
    """A bar that buckles at the elongation -buckling/stiffness, with `plateau` times the stiffness
    beyond; it resists with the first stiffness down to `TAUT` times its length below.
    """

    def __init__(self, stiffness: float, length: float, buckling: float, plateau: float) -> None:
        self.buckling = buckling
        place, lost = -buckling / stiffness, (1 - plateau) * stiffness
        values = [stiffness, place, plateau, TAUT * length]
        self._set(_buckling_law(), values, length, UNBOUNDED)
        self.kinks = ((place, lost, 1.0, -1.0),) if plateau < 1 else ()
        numbers = {"buckling": buckling, "plateau": plateau}
        self._origin = call("BucklingBar", stiffness=stiffness, length=length, **numbers)


class StringOfLaw(Potential):
    """A string whose tension is that of a potential of the elongation, slack below 0 m."""

    tension_only = True

    def __init__(self, law: Potential, length: float) -> None:
        self.given = law
        margin, high = TAUT * length, law.domain[1]
        self._set(Slackening(law.law), [*law.values, margin], length, (-math.inf, high), law.ends)
        stiffness = float(law.stiffness(min(margin, high / 2)))
        bends = tuple(kink for kink in law.kinks if kink[0] > 0)
        self.kinks = ((0.0, stiffness, 1.0, 1.0), *bends)
        self._origin = f"StringOfLaw({law!r}, length={length:g})"


@dataclass(frozen=True)
class Slackening:
    """A law of strings: that of a potential above 0, and no tension below.

    Attributes
    ----------
    law : Law
    """

    law: Any

    @property
    def compiled(self) -> Any:
        """Names of the compiled functions of the law."""
        return self.law.compiled

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the law's parameters, followed by "margin"."""
        return (*map(str, self.law.parameters), "margin")

    @property
    def name(self) -> str:
        """Name of the law in other processes, or "" if it has none."""
        return f"slackening {name}" if (name := getattr(self.law, "name", "")) else ""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation, parameters and forms in CasADi; see `law.Law.forms`."""
        import casadi as ca

        r, p, (energy, tension, *higher) = self.law.forms()
        margin = ca.SX.sym("margin")
        (at_rest,) = ca.substitute([energy], [r], [ca.SX(0)])
        above, taut = r > SMALLEST, r > -margin
        forms = [ca.if_else(above, energy - at_rest, 0), ca.if_else(above, tension, 0)]
        forms += [ca.if_else(taut, form, 0) for form in higher]
        return r, ca.vertcat(p, margin), forms


class WoundMember(Potential):
    """A member whose natural length may change, with EA [N] or a stiffness [N/m] that stays.

    The elongation is measured from `length`, where the natural length is another.
    """

    _varied = ("natural",)
    lasts = True  # in all of a run: near length 0 the stiffness has no bound

    def __init__(
        self, stiffness: float, length: float, tension_only: bool, keeps_EA: bool, name: str
    ) -> None:
        self._name, self.tension_only = name, tension_only
        values = [stiffness, length, length, TAUT * length]
        self._set(_law_of_wound(tension_only, keeps_EA), values, length, UNBOUNDED)

    @property
    def kinks(self) -> tuple[Kink, ...]:
        """See `Potential.kinks`."""
        stiffness, natural, length, _ = self.values.tolist()
        return ((natural - length, stiffness, 1.0, 1.0),) if self.tension_only else ()

    def _with(self, parameters: dict[str, float]) -> Potential:
        natural = parameters["natural"]
        check.number(f"natural length of {self._name}", natural, above=0, unit="m")
        return super()._with(parameters)

    def __repr__(self) -> str:
        stiffness, natural, *_ = self.values.tolist()
        kind = "string" if self.tension_only else "bar"
        return f"WoundMember({kind}, {stiffness:g}, natural={natural:g})"


@once
def _law(tension_only: bool) -> Law:
    import sympy as sp

    from derivations import member

    r, positive_part, margin = sp.symbols("r positive_part margin", real=True)
    stretched = member.energy(member.natural + r)
    if not tension_only:
        return Law(stretched, r, (member.stiffness,))
    has_tension, taut = sp.Heaviside(r - SMALLEST), sp.Heaviside(r + margin)
    tension, known = sp.diff(stretched, r).subs(r, positive_part), (member.stiffness, margin)
    return Law(
        has_tension * stretched, r, known, tension, ((positive_part, has_tension * r, taut),)
    )


@once
def _law_of_wound(tension_only: bool, keeps_axial: bool) -> Law:
    """As `_law`, with the natural length and that from which r is measured as parameters."""
    import sympy as sp

    from derivations import member

    r, positive_part, margin = sp.symbols("r positive_part margin", real=True)
    natural, length, axial = sp.symbols("natural length EA", positive=True)
    k = axial / natural if keeps_axial else member.stiffness
    stretched = member.energy(member.natural + r).subs(member.stiffness, k)
    longer = r + (length - natural)
    known = (axial if keeps_axial else member.stiffness, natural, length, margin)
    tension = sp.diff(stretched, r)
    has_tension, taut = sp.Heaviside(longer - SMALLEST), sp.Heaviside(longer + margin)
    if not tension_only:
        has_tension = taut = sp.Integer(1)
    return Law(
        has_tension * stretched.subs(r, longer),
        r,
        known,
        tension.subs(r, positive_part),
        ((positive_part, has_tension * longer, taut),),
    )


@once
def _buckling_law() -> Law:
    import sympy as sp

    from derivations import member

    r, past, least, plateau, margin = sp.symbols("r past least plateau margin", real=True)
    stretched = member.energy(member.natural + r)
    pull = sp.diff(stretched, r)
    buckled = sp.Heaviside(least - r)
    beyond = buckled * (r - least)
    energy = stretched.subs(r, r - beyond) + beyond * (
        pull.subs(r, least) + plateau * pull.subs(r, beyond) / 2
    )
    tension = pull.subs(r, r - past) + plateau * pull.subs(r, past)
    past_of = past, beyond, sp.Heaviside(least - r - margin)
    return Law(energy, r, (member.stiffness, least, plateau, margin), tension, (past_of,))


def network(structure: Any, natural_lengths: Any, **given: Any) -> Network:
    """The network of a structure; see `Structure.network`.

    Parameters
    ----------
    structure : Structure
    natural_lengths : dict or None
        {member: expression of t [m]}.
    **given
        Further arguments of `Network`.

    Returns
    -------
    Network
    """
    changing = {} if natural_lengths is None else natural_lengths
    if not isinstance(changing, Mapping):
        raise TensegrityError(
            f"natural_lengths {check.shown(changing)} must be a dict {{member: expression of t}}"
        )
    of = structure.cable_segments
    springs = [spring_of(structure, member) for member in range(len(structure.ends))]
    for key, expression in changing.items():
        member = structure.member_number(key)
        natural = expression / len(of.of(member))
        springs[member] = wound(structure, member).over_time(natural=natural)
    each = range(len(springs)) if of.owner is None else of.owner.tolist()
    at, ends = structure.positions, structure.segments
    natural = of.each(structure.natural_lengths / of.over(np.ones(len(ends))))
    given["cables"] = [of.of(cable).tolist() for cable in of.cables]
    if structure.has_heavy_members:
        given["bond_mass"] = of.each(structure.member_mass)
    springs = [springs[member] for member in each]
    return Network(at, ends, springs, lengths=natural, mass=structure.mass, **given)


def spring_of(structure: Any, member: int) -> Potential:
    """The spring of a member of a structure, by its number, or of each segment of a cable."""
    segments = len(structure.cable_segments.of(member))
    natural = float(structure.natural_lengths[member]) / segments
    length = float(f"{natural:.3g}")  # equal up to round-off, members have one spring
    if segments > 1 and member in structure.law:
        raise TensegrityError(
            f"cable {member} over nodes has a law: in motion its tension is linear in its length"
        )
    stiffness, string = (
        segments * float(structure.stiffnesses[member]),
        bool(structure.is_string[member]),
    )
    if member in structure.law:
        law = structure.law[member]
        return StringOfLaw(law, length) if string else law
    if structure.buckling is not None and not string:
        buckling = float(structure.buckling[member])
        return BucklingBar(stiffness, length, buckling, structure.plateau)
    return (StringSpring if string else BarSpring)(stiffness, length)


def wound(structure: Any, member: int) -> WoundMember:
    """The spring of a member whose natural length changes."""
    name, string = structure.name_of(member), bool(structure.is_string[member])
    if member in structure.law or (structure.buckling is not None and not string):
        what = "a law" if member in structure.law else "a buckling load"
        raise TensegrityError(
            f"{name} has {what}: natural lengths in motion change of linear members only"
        )
    keeps = bool(structure.keeps_EA[member])
    segments = len(structure.cable_segments.of(member))
    natural = float(structure.natural_lengths[member]) / segments
    stiffness = float(structure.EA[member] if keeps else segments * structure.stiffnesses[member])
    return WoundMember(stiffness, natural, string, keeps, name)
