"""Contacts that dissipate: the elastic force plus a part that depends on the rate of the overlap.

The force of a contact is compressive: where a formula gives less than 0 it is 0.  The models have
one bead radius and no rotation: rolling, tangential springs and plastic contacts are left out.
Sources: G. Kuwabara, K. Kono, Jpn. J. Appl. Phys. 26, 1230 (1987), with N. V. Brilliantov and
others, Phys. Rev. E 53, 5382 (1996); K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42, 440 (1975);
R. Carretero-Gonzalez and others, Phys. Rev. Lett. 102, 024102 (2009).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from granular.beads import Bead
from granular.contact import Contact, hertz
from tensegrity import Force, TensegrityError, check
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from granular.contact import ContactLaw
    from granular.materials import Material

RTOL, ATOL = 1e-12, 1e-15  # of a collision in units of its own length, time and speed
HARDEST = 1e8  # largest constant in these units that is tried for a restitution
UNITS = {"Kuwabara-Kono": "s", "Hunt-Crossley": "s/m", "Carretero-Gonzalez": "N (s/m)^a",
         "viscous": "N s/m"}  # fmt: skip


@dataclass(frozen=True)
class Dissipation:
    """The part of a contact force that depends on the rate of the overlap.

    Attributes
    ----------
    model : str
        A key of `UNITS`.
    constant : float
        In the unit of the model, >= 0.
    power : float
        Of the rate, > 0; 1 but for Carretero-Gonzalez.
    """

    model: str
    constant: float
    power: float = 1.0

    def force(self, d: Any, rate: Any, stiffness: Any, exponent: Any, constant: Any) -> Any:
        """The formula: the force of a contact [N] besides its elastic one.

        Parameters
        ----------
        d, rate : sympy.Expr
            Overlap [m], >= 0, and its rate [m/s].
        stiffness, exponent, constant : sympy.Expr
            Those of the elastic force, and that of the dissipation.
        """
        import sympy as sp

        elastic = stiffness * d**exponent
        if self.model == "Kuwabara-Kono":  # c times the rate of the elastic force
            return constant * rate * exponent * stiffness * d ** (exponent - 1)
        if self.model == "Hunt-Crossley":
            return constant * rate * elastic
        size = rate if self.power == 1 else sp.sign(rate) * abs(rate) ** _exact(self.power)
        return sp.Piecewise((constant * size, d > 0), (0, True))

    def scaled(self, contact: Contact, mass: float, speed: float) -> float:
        """The constant in units of a collision: its speed, the mass, and stiffness 1."""
        exponent = contact.exponent
        length = (mass * speed**2 / contact.constant) ** (1 / (exponent + 1))
        force = contact.constant * length**exponent
        unit = {"Kuwabara-Kono": length / speed, "Hunt-Crossley": 1 / speed}
        return self.constant / unit.get(self.model, force / speed**self.power)


def _exact(number: float) -> Any:
    """A number as a ratio where it is a simple one, so that powers become roots."""
    import sympy as sp

    ratio = sp.nsimplify(number, rational=True)
    return ratio if ratio.q <= 8 else sp.Float(number)


def _compressive(model: Dissipation, d: Any, rate: Any, *constants: Any) -> Any:
    """What a model adds to the elastic force, so that the whole is not below 0."""
    import sympy as sp

    elastic = constants[0] * d ** constants[1]
    return sp.Max(elastic + model.force(d, rate, *constants), 0) - elastic


def forces_of(contacts: Sequence[Contact], overlaps: Sequence[float]) -> list[Force]:
    """The dissipative parts of contacts in a row as forces in its bonds.

    Parameters
    ----------
    contacts : sequence of Contact
    overlaps : sequence of float
        Of each at elongation 0 [m].
    """
    import sympy as sp

    kinds: dict[Any, list[int]] = {}
    for number, one in enumerate(contacts):
        if (loss := one.dissipation) is not None and loss.constant:
            kinds.setdefault((loss.model, loss.power, one.exponent), []).append(number)
    r, rate, stiffness, constant, begin = sp.symbols("r rate stiffness constant overlap")
    found = []
    for (_, _, exponent), at in kinds.items():
        of = [contacts[k] for k in at]
        d = sp.Max(begin - r, 0)
        force = _compressive(of[0].dissipation, d, -rate, stiffness, _exact(exponent), constant)
        values = {
            "stiffness": [x.constant for x in of],
            "constant": [x.dissipation.constant for x in of],
            "overlap": [float(overlaps[k]) for k in at],
        }
        found.append(Force(-force, "bonds", at, values))
    return found


# collisions


def restitution(contact: Contact, mass: float, speed: float) -> tuple[float, float]:
    """Coefficient of restitution and duration of a collision without other forces.

    Parameters
    ----------
    contact : Contact
    mass : float
        Reduced mass of the partners [kg], > 0: m1 m2/(m1 + m2), that of the bead at a wall.
    speed : float
        Of approach [m/s], > 0.

    Returns
    -------
    restitution : float
        Speed of separation over speed of approach, in (0, 1].
    duration : float
        From the first contact until the force returns to 0 [s].
    """
    mass = check.number("reduced mass", mass, above=0, unit="kg")
    speed = check.number("speed of approach", speed, above=0, unit="m/s")
    loss = contact.dissipation or Dissipation("viscous", 0.0)
    value, time = _collision(loss.model, loss.power, contact.exponent,
                             loss.scaled(contact, mass, speed))  # fmt: skip
    length = (mass * speed**2 / contact.constant) ** (1 / (contact.exponent + 1))
    return value, time * length / speed


@once
def _collision(model: str, power: float, exponent: float, constant: float) -> tuple[float, float]:
    """Restitution, and duration, of a collision of mass, stiffness and speed 1."""
    import sympy as sp
    from scipy.integrate import solve_ivp

    force = _force_function(model, power, exponent)

    def rates(t: float, y: Any) -> tuple[float, float]:
        return y[1], -force(max(y[0], 0.0), y[1], constant)

    def released(t: float, y: Any) -> float:
        return unclipped(max(y[0], 0.0), y[1], constant) if y[1] < 0 else 1.0

    def separated(t: float, y: Any) -> float:
        return y[0] if y[1] < 0 else 1.0

    d, rate, c = sp.symbols("d rate c")
    model_of = Dissipation(model, 1.0, power)
    whole = d ** _exact(exponent) + model_of.force(d, rate, 1, _exact(exponent), c)
    unclipped = sp.lambdify((d, rate, c), whole, "math")
    for event in (released, separated):
        event.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        rates, (0.0, 1e9), (0.0, 1.0), "DOP853", events=(released, separated), rtol=RTOL, atol=ATOL
    )
    return -float(run.y[1, -1]), float(run.t[-1])


@once
def _force_function(model: str, power: float, exponent: float) -> Any:
    """The whole force of a contact of stiffness 1 as a function of overlap, rate and constant."""
    import sympy as sp

    d, rate, c = sp.symbols("d rate c")
    n = _exact(exponent)
    whole = d**n + _compressive(Dissipation(model, 1.0, power), d, rate, sp.Integer(1), n, c)
    return sp.lambdify((d, rate, c), whole, "math")


def _solved(model: Dissipation, contact: Contact, mass: float, e: float, speed: float) -> float:
    """The constant for which a collision has a restitution."""
    from scipy.optimize import brentq

    if e == 1:
        return 0.0

    def excess(log: float) -> float:
        return _collision(model.model, model.power, contact.exponent, math.exp(log))[0] - e

    low = high = 0.0
    while excess(low) < 0:
        low -= 2.0
    while excess(high) > 0:
        high += 2.0
        if high > math.log(HARDEST):
            least = excess(high) + e
            raise TensegrityError(
                f"restitution {e:g} at {speed:g} m/s is reached by no constant of {model.model}: "
                f"the range is {least:.3g} to 1"
            )
    found = math.exp(brentq(excess, low, high, xtol=1e-13, rtol=1e-13))
    return found / replace(model, constant=1.0).scaled(contact, mass, speed)


def _law(
    model: Dissipation, name: str, constant: Any, e: float | None, speed: float | None
) -> ContactLaw:
    """A contact law of a model, given by its constant, or by a restitution at a speed."""
    if (constant is None) == (e is None) or (e is None) != (speed is None):
        raise TensegrityError(
            f"{model.model} is given by {name}, or by restitution and speed: exactly one of these"
        )
    if constant is not None:
        value = check.number(f"{name} of {model.model}", constant, least=0, unit=UNITS[model.model])
        given = replace(model, constant=value)
        return lambda bead, other: replace(hertz(bead, other), dissipation=given)
    assert e is not None and speed is not None
    e = check.number("restitution", e, above=0)
    if e > 1:
        raise TensegrityError(f"restitution {e:g} must be at most 1")
    speed = check.number("speed of the restitution", speed, above=0, unit="m/s")

    def law(bead: Bead, other: Bead | Material) -> Contact:
        contact = hertz(bead, other)
        mass = bead.mass
        if isinstance(other, Bead):
            mass = bead.mass * other.mass / (bead.mass + other.mass)
        found = _solved(model, contact, mass, e, speed)
        return replace(contact, dissipation=replace(model, constant=found))

    return law


def kuwabara_kono(
    c: float | None = None, *, restitution: float | None = None, speed: float | None = None
) -> ContactLaw:
    """Viscoelastic spheres: F = A d^(3/2) + (3/2) A c d^(1/2) d'.

    Parameters
    ----------
    c : float, optional
        Time constant [s], >= 0.
    restitution, speed : float, optional
        Instead of c: the coefficient of restitution, in (0, 1], of a collision of each two
        partners at this speed of approach [m/s]; a wall has infinite mass.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact
        For the argument `law` of `granular.chain`.

    Raises
    ------
    TensegrityError
        None or both given, a negative constant, or a restitution that no constant reaches.

    Examples
    --------
    >>> from granular import Bead, chain, kuwabara_kono
    >>> from granular.materials import STEEL
    >>> law = kuwabara_kono(restitution=0.9, speed=0.5)
    >>> row = chain([Bead(0.00476, STEEL)] * 3, end=STEEL, law=law)
    >>> f"{row.contacts[0].dissipation.constant:.3g} s"
    '3.04e-07 s'
    """
    return _law(Dissipation("Kuwabara-Kono", 0.0), "c", c, restitution, speed)


def hunt_crossley(
    c: float | None = None, *, restitution: float | None = None, speed: float | None = None
) -> ContactLaw:
    """Damping in proportion to the elastic force: F = A d^(3/2) (1 + c d').

    Parameters
    ----------
    c : float, optional
        [s/m], >= 0.
    restitution, speed : float, optional
        As of `kuwabara_kono`.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact

    Raises
    ------
    TensegrityError
        As for `kuwabara_kono`.
    """
    return _law(Dissipation("Hunt-Crossley", 0.0), "c", c, restitution, speed)


def viscous(
    c: float | None = None, *, restitution: float | None = None, speed: float | None = None
) -> ContactLaw:
    """A dashpot while in contact: F = A d^(3/2) + c d'.

    Parameters
    ----------
    c : float, optional
        [N s/m], >= 0.
    restitution, speed : float, optional
        As of `kuwabara_kono`.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact

    Raises
    ------
    TensegrityError
        As for `kuwabara_kono`.
    """
    return _law(Dissipation("viscous", 0.0), "c", c, restitution, speed)


def carretero_gonzalez(
    g: float | None = None,
    a: float = 1.0,
    *,
    restitution: float | None = None,
    speed: float | None = None,
) -> ContactLaw:
    """A power of the rate while in contact: F = A d^(3/2) + sign(d') g |d'|^a.

    Parameters
    ----------
    g : float, optional
        [N (s/m)^a], >= 0.
    a : float, optional
        Exponent, > 0.
    restitution, speed : float, optional
        As of `kuwabara_kono`, for the given a.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact

    Raises
    ------
    TensegrityError
        As for `kuwabara_kono`; an exponent that is not above 0.
    """
    a = check.number("exponent a of Carretero-Gonzalez", a, above=0)
    return _law(Dissipation("Carretero-Gonzalez", 0.0, a), "g", g, restitution, speed)
