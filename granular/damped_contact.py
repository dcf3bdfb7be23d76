"""Contact laws that adhere or dissipate, and the forces that these add to a chain.

A law is given by its constant, or by the coefficient of restitution at a speed, from which the
constant of each two partners follows.  The models and their sources are in `granular.dissipation`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np

from granular.beads import Bead, Material
from granular.contact import Contact, ContactLaw, hertz, refuse_attraction
from granular.dissipation import (
    ELASTIC,
    UNITS,
    Dissipation,
    collision,
    compressive,
    elastic_of,
    form_of,
)  # fmt: skip
from tensegrity import Force, Potential, PowerLaw, TensegrityError, check
from tensegrity.checked import checked
from tensegrity.once import once
from tensegrity.typing import FractionOrOne, NotNegative, Positive, Speed

HARDEST = 1e8  # largest constant that is tried for a restitution, in units of the collision


@dataclass(frozen=True)
class Adhesive(Contact):
    """A contact that also pulls by a constant force while the partners overlap.

    Attributes
    ----------
    pull : float
        Pull-off force [N], >= 0.
    """

    pull: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        pull = check.number("pull-off force", self.pull, least=0, unit="N")
        object.__setattr__(self, "pull", pull)

    @property
    def potential(self) -> Potential:
        """Elastic energy [J] by the elongation from the touch [m], minus the overlap; 0 apart."""
        return _adhesive(self.exponent).varied({"stiffness": self.constant, "pull": self.pull})


@once
def _adhesive(exponent: float) -> Potential:
    import sympy as sp

    r, (stiffness, pull) = sp.Symbol("r", real=True), sp.symbols("stiffness pull")
    d, n = sp.Max(-r, 0), sp.nsimplify(exponent) + 1
    return Potential(stiffness * d**n / n - pull * d, r, {stiffness: 1.0, pull: 0.0})


def forces_of(
    contacts: Sequence[Contact],
    overlaps: Sequence[float],
    on: str = "bonds",
    others: Sequence[Contact] = (),
) -> list[Force]:
    """The dissipative parts of contacts as forces.

    Parameters
    ----------
    contacts : sequence of Contact
    overlaps : sequence of float
        Overlap of each at elongation 0 [m].
    on : {"bonds", "walls"}, optional
        Whether the contacts are bonds or wall contacts of the scene.
    others : sequence of Contact, optional
        Contacts that may form.

    Returns
    -------
    list of Force
        One for each model that occurs; without places if it occurs only in `others`.
    """
    return [
        _force(contacts, overlaps, at, partial(_of_model, model, form, values, on))
        for (model, form, values), at in _alike(contacts, others).items()
    ]


def friction_of(contacts: Sequence[Contact], coefficient: float, speed: float) -> list[Force]:
    """Coulomb friction of contacts with walls, regularised over a speed of slip.

    Parameters
    ----------
    contacts : sequence of Contact
    coefficient : float
        Of friction.
    speed : float
        Speed of slip at which friction is coefficient/sqrt(2) times the normal force [m/s].

    Returns
    -------
    list of Force
    """
    none, more = [0.0] * len(contacts), {"friction": coefficient, "slip_speed": speed}
    return [
        _force(contacts, none, at, partial(_of_model, model, form, values, "walls", True), more)
        for (model, form, values), at in _alike(contacts, rub=True).items()
    ]


def _alike(
    contacts: Sequence[Contact], others: Sequence[Contact] = (), rub: bool = False
) -> dict[Any, list[int]]:
    """Numbers of the contacts of one formula that dissipate, or rub, by `_kind`."""
    kinds: dict[Any, list[int]] = {}
    known: dict[int, Any] = {}
    for number, one in enumerate([*contacts, *others]):
        if id(one) not in known:
            known[id(one)] = _kind(one, rub)
        if known[id(one)] is not None:
            at = kinds.setdefault(known[id(one)], [])
            at.extend([number] if number < len(contacts) else [])
    return kinds


def _kind(one: Contact, rubs: bool) -> tuple[Dissipation, Any, tuple[float, ...]] | None:
    """The model of the losses, with constant 0 or 1, the form of the elastic force, and values of
    its parameters for which it is defined, if not all are; None of a contact without force."""
    loss = one.dissipation if one.dissipation and one.dissipation.constant else ELASTIC
    if not (loss.constant or rubs):
        return None
    refuse_attraction(one, "it rubs" if rubs else f"it has losses of {loss.model}")
    form, law = form_of(one.potential), one.potential
    values = () if isinstance(law, PowerLaw) else tuple(law.parameters.values())
    return replace(loss, constant=float(bool(loss.constant))), form, values


@once
def _of_model(
    model: Dissipation, form: Any, values: tuple[float, ...], on: str, rubs: bool = False
) -> Force:
    """What a model adds to elastic contacts of a form, or the friction of such contacts."""
    import sympy as sp

    r, rate, constant, begin = sp.symbols("r rate constant overlap")
    d, (elastic, symbols) = sp.Max(begin - r, 0), elastic_of(form)
    added = compressive(model, d, -rate, elastic, constant)
    expression: Any = added if on == "walls" else -added
    if rubs:
        slip, mu, v0 = sp.symbols("slip friction slip_speed")
        normal = elastic(d) + added
        expression = sp.Integer(0), -mu * normal * slip / sp.sqrt(slip**2 + v0**2)
    parts = expression if rubs else (expression,)
    used = sorted({str(s) for one in parts for s in one.free_symbols} - {"r", "rate", "slip"})
    like = dict(zip(map(str, symbols), values, strict=False))
    return Force(expression, on, parameters={name: like.get(name, 1.0) for name in used})


def _force(
    contacts: Sequence[Contact], overlaps: Sequence[float], at: list[int], of_model: Any,
    more: dict[str, float] | None = None,
) -> Force:  # fmt: skip
    """The force of a model in some contacts, with the constants of each."""
    of, force = [contacts[k] for k in at], of_model()
    names = [str(s) for s in elastic_of(of_model.args[1])[1]]
    table = np.reshape([x.potential.values[: len(names)] for x in of], (len(of), len(names)))
    values: dict[str, Any] = {
        **dict(zip(names, table.T, strict=True)),
        "constant": [(x.dissipation or ELASTIC).constant for x in of],
        "overlap": [float(overlaps[k]) for k in at],
        **(more or {}),
    }
    return force.placed(at, {name: values[name] for name in force.parameters})


def _solved(model: Dissipation, contact: Contact, mass: float, e: float, speed: float) -> float:
    """The constant for which a collision has a restitution."""
    from scipy.optimize import brentq

    if e == 1:
        return 0.0

    def excess(log: float) -> float:
        return collision(model.model, model.power, contact.exponent, (), math.exp(log))[0] - e

    low = high = 0.0
    while excess(low) < 0:
        low -= 2.0
    while excess(high) > 0:
        high += 2.0
        if high > math.log(HARDEST):
            least = excess(high) + e
            raise TensegrityError(
                f"restitution {e:g} at {speed:g} m/s is not attained by any constant of "
                f"{model.model}: the range is {least:.3g} to 1"
            )
    constant = math.exp(brentq(excess, low, high, xtol=1e-13, rtol=1e-13))
    try:
        return constant / replace(model, constant=1.0).scaled(
            contact.constant, contact.exponent, mass, speed
        )
    except (OverflowError, ZeroDivisionError):
        raise TensegrityError(
            f"speed of the restitution {speed:g} m/s is too extreme: no number holds its energy"
        ) from None


@checked
def dmt(work: Annotated[float, ">= 0", "J/m^2"]) -> ContactLaw:
    """The adhesion of Derjaguin, Muller and Toporov: F = A d^(3/2) - 2 pi w R while in contact.

    The force jumps at both ends of a contact, and gives back all energy: for small, stiff beads.
    J. Colloid Interface Sci. 53, 314 (1975).

    Parameters
    ----------
    work : float
        Of adhesion w [J/m^2], >= 0; R is the effective radius, 1/R = 1/R1 + 1/R2.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact

    Raises
    ------
    TensegrityError
        A negative work of adhesion.
    """

    def law(bead: Bead, other: Bead | Material) -> Contact:
        radius = bead.contact_radius
        if isinstance(other, Bead):
            radius *= other.contact_radius / (bead.contact_radius + other.contact_radius)
        return Adhesive(hertz(bead, other).constant, pull=2 * math.pi * work * radius)

    return law


@checked
def _law(
    model: Dissipation,
    name: str,
    constant: Any,
    restitution: FractionOrOne | None,
    speed: Speed | None,
) -> ContactLaw:
    """A contact law of a model, given by its constant, or by a restitution at a speed."""
    if (constant is None) == (restitution is None) or (restitution is None) != (speed is None):
        raise TensegrityError(
            f"{model.model} is given by {name}, or by restitution and speed: exactly one of these"
        )
    if constant is not None:
        value = check.number(f"{name} of {model.model}", constant, least=0, unit=UNITS[model.model])
        given = replace(model, constant=value)
        return lambda bead, other: replace(hertz(bead, other), dissipation=given)
    assert restitution is not None
    assert speed is not None

    def law(bead: Bead, other: Bead | Material) -> Contact:
        contact = hertz(bead, other)
        solved = _solved(model, contact, _reduced(bead, other), restitution, speed)
        return replace(contact, dissipation=replace(model, constant=solved))

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
        Neither or both given, a negative constant, or a restitution that no constant attains.

    Examples
    --------
    >>> from granular import Bead, chain, kuwabara_kono, materials
    >>> steel = materials["steel"]
    >>> law = kuwabara_kono(restitution=0.9, speed=0.5)
    >>> row = chain([Bead(4.76e-3, steel)] * 3, end=steel, law=law)
    >>> [f"{contact.dissipation.constant:.3g} s" for contact in row.contacts]
    ['3.3e-07 s', '3.3e-07 s', '3.79e-07 s']
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


@checked
def tsuji(
    alpha: NotNegative | None = None, *, restitution: FractionOrOne | None = None
) -> ContactLaw:
    """One coefficient of restitution at all speeds: F = A d^(3/2) + alpha sqrt(m A) d^(1/4) d'.

    Parameters
    ----------
    alpha : float, optional
        >= 0; m is the reduced mass of the two partners, at a wall that of the bead.
    restitution : float, optional
        Instead of alpha, in (0, 1]; a contact ends where its force is 0.

    Returns
    -------
    callable (Bead, Bead or Material) -> Contact

    Raises
    ------
    TensegrityError
        Neither or both given, a negative alpha, or a restitution outside (0, 1].

    Examples
    --------
    >>> from granular import Bead, materials, tsuji
    >>> bead = Bead(4.76e-3, materials["steel"])
    >>> contact = tsuji(restitution=0.5)(bead, bead)
    >>> [f"{contact.restitution(bead.mass / 2, speed)[0]:.9f}" for speed in (0.01, 1.0)]
    ['0.500000000', '0.500000000']
    """
    if (alpha is None) == (restitution is None):
        raise TensegrityError("Tsuji is given by alpha, or by restitution: exactly one of these")
    value: Any = alpha if restitution is None else _ratio(restitution, math.sqrt(5))

    def law(bead: Bead, other: Bead | Material) -> Contact:
        loss = Dissipation("Tsuji", value * math.sqrt(_reduced(bead, other)))
        return replace(hertz(bead, other), dissipation=loss)

    return law


def _ratio(e: float, critical: float) -> float:
    """The damping, of a critical one, after which a force that is never attractive gives back e.

    With z = 2/(n + 1) d^((n + 1)/2), and time in proportion to d^((1 - n)/2), the motion is z'' +
    2 b z' + z = 0 at all speeds; where its force is 0 again, -ln(e)/2 = b arccos(b)/sqrt(1 - b^2).
    """
    from scipy.optimize import brentq

    half = -math.log(e) / 2

    def excess(b: float) -> float:
        angle = math.acos(b) if b < 1 else math.acosh(b)
        side = math.sqrt(abs(1 - b)) * math.sqrt(1 + b)
        return (b * angle / side if side else 1.0) - half

    return critical * float(brentq(excess, 0, math.exp(half) + 1, xtol=1e-15, rtol=1e-15))


def _reduced(bead: Bead, other: Bead | Material) -> float:
    """Reduced mass of two partners [kg]; a wall has infinite mass."""
    return 1 / (1 / bead.mass + (1 / other.mass if isinstance(other, Bead) else 0.0))


@checked
def carretero_gonzalez(
    g: float | None = None,
    a: Positive = 1.0,
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
    return _law(Dissipation("Carretero-Gonzalez", 0.0, a), "g", g, restitution, speed)
