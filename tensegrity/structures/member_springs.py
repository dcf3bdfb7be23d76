"""The springs of bars and strings, and the network of a structure in motion.

Elongations are measured from the natural length, of a member whose natural length changes from
that of the structure.  All members have one law: a tension as a function of the elongation from
the natural length, and what becomes of it where strings slacken or bars buckle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.law import DERIVATIVES
from tensegrity.errors import TensegrityError
from tensegrity.scenes.network import Network
from tensegrity.springs.kinks import TAUT, Kink
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

SMALLEST = 1e-100  # elongation above which a string has tension [m]
UNBOUNDED = -math.inf, math.inf
NATURAL, LENGTH = "natural length", "length at first"  # parameters, no names of a law's symbols


@dataclass(frozen=True)
class MemberLaw:
    """The law of a member: above a kink that of a potential or of Hooke, below it a plateau.

    Attributes
    ----------
    of : Law or None
        Of the elongation from the natural length; None for tensions in proportion to it.
    kink : {"", "slack", "buckling"}
        What becomes of the member at elongation 0, or at minus `squeeze`: its load over k [m] or,
        times the natural length, over EA.
    winds, keeps_EA : bool
        Whether the natural length changes, and whether EA [N] is given in place of k [N/m].
    """

    of: Any
    kink: str
    winds: bool
    keeps_EA: bool
    compiled = DERIVATIVES
    name = ""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters: of the tension, and what kinks and winches need."""
        bends = ("squeeze", "plateau") * (self.kink == "buckling")
        lengths = (NATURAL,) * self.winds + (LENGTH,) * (self.winds or bool(self.kink))
        return *self.own, *bends, *lengths

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the parameters of the tension."""
        own = ("EA" if self.keeps_EA else "k",) if self.of is None else self.of.parameters
        return tuple(map(str, own))

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation, parameters and forms in CasADi; see `law.Law.forms`."""
        import casadi as ca

        from derivations import member
        from tensegrity.engine.law import to_casadi

        r, e = ca.SX.sym("r"), ca.SX.sym("e")
        p = {name: ca.SX.sym(name) for name in self.parameters[len(self.own) :]}
        longer = r + (p[LENGTH] - p[NATURAL]) if self.winds else r
        if self.of is None:
            own = ca.SX.sym("k")
            k = own / p[NATURAL] if self.keeps_EA else own
            energy = member.energy(member.natural + member.length)
            stretched = to_casadi(energy, (member.stiffness, member.length))(k, e)
            tension = ca.gradient(stretched, e)
            forms = [stretched, tension, ca.gradient(tension, e), ca.SX(0)]
        else:
            e, own, forms = self.of.forms()
        if self.kink == "slack":
            forms = _slackening(forms, e, TAUT * p[LENGTH])
        elif self.kink:
            least = -p["squeeze"] * (p[NATURAL] if self.keeps_EA else 1)
            forms = _buckling(forms, e, least, p["plateau"] * k, TAUT * p[LENGTH])
        return r, ca.vertcat(own, *p.values()), ca.substitute(list(forms), [e], [longer])


def _slackening(forms: Any, e: Any, margin: Any) -> list[Any]:
    """Forms without tension below elongation 0, from where on energies count; stiffnesses go on
    down to a margin below."""
    import casadi as ca

    energy, tension, *higher = forms
    (at_rest,) = ca.substitute([energy], [e], [ca.SX(0)])
    above, taut = e > SMALLEST, e > -margin
    values = [ca.if_else(above, energy - at_rest, 0), ca.if_else(above, tension, 0)]
    return [*values, *(ca.if_else(taut, form, 0) for form in higher)]


def _buckling(forms: Any, e: Any, least: Any, slope: Any, margin: Any) -> list[Any]:
    """Linear forms that go on with a slope below a least elongation; as `_slackening`."""
    import casadi as ca

    past, taut = ca.fmin(e - least, 0), e - least > -margin
    energy, tension = ca.substitute(list(forms[:2]), [e], [e - past])
    values = [energy + (tension + slope * past / 2) * past, tension + slope * past]
    return [*values, ca.if_else(taut, forms[2], slope), ca.SX(0)]


class MemberSpring(Potential):
    """The spring of a bar or a string.

    Parameters
    ----------
    stiffness : float
        EA [N] if it is kept, else k [N/m]; without use where a law is given.
    length : float
        Natural length at the start, from which elongations are measured [m].
    string, keeps_EA : bool, optional
        Whether the member slackens, and whether `stiffness` is EA.
    buckling : float, optional
        Load of a bar that buckles [N].
    plateau : float, optional
        Stiffness after buckling over that before.
    law : Potential, optional
        Energy as a function of the elongation from the natural length.
    member : str, optional
        Name of a member whose natural length, the argument `NATURAL`, may change.

    Attributes
    ----------
    of : Potential or None
        The given law, whose parameters are the first of the member's.
    """

    lasts = True  # in all of a run: near length 0 the stiffness has no bound

    def __init__(
        self,
        stiffness: float,
        length: float,
        string: bool = False,
        keeps_EA: bool = False,
        buckling: float | None = None,
        plateau: float = 0.0,
        law: Potential | None = None,
        member: str = "",
    ) -> None:
        given: dict[str, Any] = {"stiffness": stiffness, "length": length, "string": string}
        given |= {"keeps_EA": keeps_EA, "buckling": buckling, "plateau": plateau}
        given |= {"law": law, "member": member}
        self.given = {key: x for key, x in given.items() if x not in (False, None, "", 0.0)}
        self.tension_only, self._name, self.of = string, member, law
        kink = "slack" if string else "" if buckling is None else "buckling"
        low, self._high = UNBOUNDED if law is None else law.domain
        self._low = -math.inf if string else low
        form = MemberLaw(None if law is None else law.law, kink, bool(member), keeps_EA)
        values = [stiffness] if law is None else law.values.tolist()
        values += [] if buckling is None else [buckling / stiffness, plateau]
        values += [length] * (len(form.parameters) - len(values))
        ends = ("lowest", "highest") if law is None else law.ends
        self._set(form, values, length, (self._low, self._high), ends)
        self._varied = (NATURAL,) if member else (form.own if law is None else (*law.parameters,))
        self._origin = f"MemberSpring({', '.join(f'{key}={x!r}' for key, x in self.given.items())})"

    @property
    def kinks(self) -> tuple[Kink, ...]:
        """See `Potential.kinks`."""
        p, found = self.parameters, ()
        size = p[NATURAL] if self.law.keeps_EA else 1.0
        if self.tension_only:
            taut = float(self.values[0]) / size
            if self.of is not None:
                taut = float(self.of.stiffness(min(TAUT * p[LENGTH], self._high / 2)))
            found += ((0.0, taut, 1.0, 1.0),)
        elif self.law.kink:
            lost = (1 - p["plateau"]) * float(self.values[0]) / size
            found += ((-p["squeeze"] * size, lost, 1.0, -1.0),) if lost else ()
        if self.of is not None:
            found += tuple(x for x in self.of.kinks if x[0] > 0 or not self.tension_only)
        moved = p[NATURAL] - p[LENGTH] if self.law.winds else 0.0
        return tuple((x[0] + moved, *x[1:]) for x in found)

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of what a linear member has derivatives by: stiffness, and those of buckling."""
        return *self.law.own, *("buckling", "plateau") * (self.law.kink == "buckling")

    def slopes(self, name: str) -> Array:
        """Derivatives of the law's parameters by one of the `arguments`, (parameters,): where the
        stiffness changes, the buckling load stays."""
        names = self.law.parameters
        row = np.eye(len(names))[names.index("squeeze" if name == "buckling" else name)]
        if self.law.kink == "buckling":
            change = {names[0]: -self.values[1], "buckling": 1.0}.get(name, 0.0)
            row[1] = change / self.values[0]
        return row

    def _with(self, parameters: dict[str, float]) -> Potential:
        made = super()._with(parameters)
        if self.law.winds:
            natural = parameters[NATURAL]
            check.number(f"natural length of {self._name}", natural, above=0, unit="m")
            moved = natural - parameters[LENGTH]
            made._domain = self._low + moved, self._high + moved
            made._origin = f"{self._origin[:-1]}, natural={natural:g})"
        return made


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
        wound = spring_of(structure, member, True)
        springs[member] = wound.over_time(**{NATURAL: expression / len(of.of(member))})
    each = range(len(springs)) if of.owner is None else of.owner.tolist()
    at, ends = structure.positions, structure.segments
    natural = of.each(structure.natural_lengths / of.over(np.ones(len(ends))))
    given["cables"] = [of.of(cable).tolist() for cable in of.cables]
    if structure.has_heavy_members:
        given["bond_mass"] = of.each(structure.member_mass)
    springs = [springs[member] for member in each]
    return Network(at, ends, springs, lengths=natural, mass=structure.mass, **given)


def spring_of(structure: Any, member: int, winds: bool = False) -> Potential:
    """The spring of a member of a structure, or of each segment of a cable over nodes.

    Parameters
    ----------
    structure : Structure
    member : int
        Its number.
    winds : bool, optional
        Whether its natural length may change.

    Returns
    -------
    Potential
    """
    segments, string = len(structure.cable_segments.of(member)), bool(structure.is_string[member])
    natural = float(structure.natural_lengths[member]) / segments
    length = natural if winds else float(f"{natural:.3g}")  # equal springs up to round-off
    law, keeps = structure.law.get(member), winds and bool(structure.keeps_EA[member])
    if law is not None and segments > 1:
        raise TensegrityError(
            f"cable {member} over nodes has a law: in motion its tension is linear in its length"
        )
    if law is not None and not string and not winds:
        return law
    given: dict[str, Any] = {"law": law, "member": structure.name_of(member) if winds else ""}
    if structure.buckling is not None and not string:
        given |= {"buckling": float(structure.buckling[member]), "plateau": structure.plateau}
    stiffness = float(structure.EA[member] if keeps else segments * structure.stiffnesses[member])
    return MemberSpring(stiffness, length, string, keeps, **given)
