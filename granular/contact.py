"""Contact laws of bead pairs and of beads on plane walls: a potential of the overlap, and losses.

Hertz's law for smooth, frictionless, linear elastic spheres and small contacts; a plane wall is
the limit of a large radius.  The constants are evaluated from `derivations.contact`.
Derivatives with respect to diameters and moduli of beads follow by the chain rule.  The diameter of
a bead enters its mass and the radius of its contacts, unless these were given separately; for beads
at fixed places, in a guide or a pack, it also enters the gaps.  The beads of a chain touch whatever
their diameters are.
Source: the talk, part II, "Hertz interaction potentials"; the paper, eqs. (3), (4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from granular.beads import Bead, Material, volume
from granular.dissipation import ELASTIC, Dissipation, collision, form_of
from tensegrity import Potential, PowerLaw, TensegrityError, check
from tensegrity.checked import checked
from tensegrity.engine.programs import derived, run
from tensegrity.printing import concise, filled
from tensegrity.springs.pressed import Pressed, crossing, overlap_under, pressed
from tensegrity.typing import Array, Mass, Number

ContactLaw = Callable[[Bead, Bead | Material], "Contact"]


C = 299_792_458.0  # m/s: speeds are below that of light
SAME = 1e-9  # difference of constants, over one, that round-off may leave
PROBE = 1e-6  # m: an overlap at which what a law says twice is compared
TINY = 1e-30  # step of a derivative through the complex plane


@dataclass(frozen=True)
class Contact:
    """The law of a contact: a power of the overlap, unless a subclass has another `potential`.

    A subclass with a law of its own returns its `potential`; springs, overlaps, energies and losses
    are asked of it.  One that attracts is in equilibrium without load at an overlap above 0.

    Attributes
    ----------
    constant : float
        alpha [N/m^exponent], > 0.
    exponent : float
        n, 3/2 after Hertz.
    dissipation : Dissipation, optional
        What the rate of the overlap adds to the force.
    """

    constant: float
    exponent: float = 1.5
    dissipation: Dissipation | None = None

    def __str__(self) -> str:
        parts = [repr(self.potential)]
        if type(self) is Contact:
            parts = [f"constant {self.constant:.6g} N/m^{self.exponent:g}"]
            parts += [f"exponent {self.exponent:g}"]
        parts += [] if self.dissipation is None else [concise(self.dissipation)]
        return filled(f"{type(self).__name__}: {', '.join(parts)}")

    def __post_init__(self) -> None:
        constant = check.number("contact constant", self.constant, above=0, unit="N/m^n")
        exponent = check.number("contact exponent", self.exponent, above=0)
        if self.dissipation is not None:
            check.kind("dissipation", self.dissipation, Dissipation)
        object.__setattr__(self, "constant", constant)
        object.__setattr__(self, "exponent", exponent)

    @property
    def potential(self) -> Potential:
        """Elastic energy [J] by the elongation from the touch [m], minus the overlap; 0 apart."""
        own = type(self)
        if own.spring is Contact.spring:
            return PowerLaw(self.constant, self.exponent)
        if own.overlap is Contact.overlap:
            raise TensegrityError(
                f"{own.__name__} gives springs from rest but not the overlap there: give its "
                "potential, from which both follow"
            )
        return Pressed(self.spring(), 0.0, -float(self.overlap(0.0)))

    @property
    def attracts(self) -> bool:
        """Whether partners that touch pull each other together."""
        return float(self.overlap(0.0)) > 0

    def overlap(self, force: Number) -> Number:
        """Overlap [m] under a compressive force [N] >= 0; any shape."""
        force = check.floats("contact force", force)  # type: ignore[assignment]
        if np.any(~(force >= 0)):
            raise TensegrityError("contact forces must be at least 0 N")
        law = self.potential
        if isinstance(law, PowerLaw):
            return (force / law.values[0]) ** (1 / law.exponent)
        return np.vectorize(lambda load: overlap_under(law, load), otypes=[float])(force)[()]

    @checked
    def restitution(
        self, mass: Mass, speed: Annotated[float, "> 0", f"< {C}", "m/s"]
    ) -> tuple[float, float]:
        """Coefficient of restitution and duration of a collision without other forces.

        Parameters
        ----------
        mass : float
            Reduced mass of the partners [kg], > 0: m1 m2/(m1 + m2), at a wall that of the bead.
        speed : float
            Of approach [m/s], > 0.

        Returns
        -------
        restitution : float
            Speed of separation over speed of approach, in (0, 1].
        duration : float
            From the first touch until the force is 0 again [s].

        Raises
        ------
        TensegrityError
            A mass or a speed that is not above 0.
        """
        loss, law, work = self.dissipation or ELASTIC, self.potential, mass * speed**2
        if isinstance(law, PowerLaw) and 0 < work / law.values[0] < math.inf:
            stiffness, n = float(law.values[0]), law.exponent
            constant = loss.scaled(stiffness, n, mass, speed)
            value, time = collision(loss.model, loss.power, n, (), constant)
            return value, time / speed * (work / stiffness) ** (1 / (n + 1))
        deepest = crossing(law, lambda d: law.energy(-d), work / 2) if 0 < work < math.inf else None
        if isinstance(law, PowerLaw) or deepest is None:
            raise TensegrityError(
                f"energy {work:g} J of a collision is beyond the range of numbers, or of {law!r}"
            )
        if loss.constant:
            refuse_attraction(self, f"it has losses of {loss.model}")
        scale, values = (deepest, speed, work / deepest), tuple(law.parameters.values())
        value, time = collision(loss.model, loss.power, form_of(law), values, loss.constant, scale)
        return value, time / speed * deepest

    def spring(self, preload: float = 0.0, length: float | None = None) -> Potential:
        """Spring of two beads in contact under a compressive preload [N], >= 0, from rest.

        `length` is the distance of their centres [m].
        """
        return pressed(self.potential, preload, length)


def hertz(bead: Bead, other: Bead | Material) -> Contact:
    """Contact of a bead with another bead, or with a plane wall of some material.

    alpha = (4/3) E* sqrt(R*) with 1/E* = sum of (1 - poisson^2)/modulus and 1/R* = sum of 1/radius
    over both partners (a wall has 1/radius = 0), exponent 3/2.  The model holds for overlaps far
    below the radii.

    Parameters
    ----------
    bead : Bead
    other : Bead or Material
        A Material stands for a plane wall.

    Returns
    -------
    Contact
        Constant in [N/m^1.5].

    Raises
    ------
    TensegrityError
        `bead` is not a Bead, or `other` is neither a Bead nor a Material.

    Examples
    --------
    >>> from granular import Bead, hertz, materials
    >>> steel = materials["steel"]
    >>> bead = Bead(diameter=10e-3, material=steel)
    >>> [f"{hertz(bead, other).constant:.4g} N/m^1.5" for other in (bead, steel)]
    ['7.07e+09 N/m^1.5', '9.998e+09 N/m^1.5']
    """
    if not isinstance(bead, Bead):
        raise TensegrityError(f"{check.shown(bead)} is not a Bead")
    one = bead.material
    if isinstance(other, Material):
        solids = one.modulus, other.modulus, one.poisson, other.poisson
        return Contact(_constant("wall", *solids, bead.contact_radius))
    if not isinstance(other, Bead):
        raise TensegrityError(f"{check.shown(other)} is neither a Bead nor a Material")
    two = other.material
    radii = bead.contact_radius, other.contact_radius
    solids = one.modulus, two.modulus, one.poisson, two.poisson
    return Contact(_constant("pair", *solids, *radii))


def is_hertz(law: Potential, one: Bead | Material, other: Bead | Material) -> bool:
    """Whether a potential is that of Hertz's contact of two partners, whatever its preload.

    Parameters
    ----------
    law : Potential
    one, other : Bead or Material
        One a bead at least; a Material stands for a plane wall.

    Returns
    -------
    bool
    """
    bead, partner = (one, other) if isinstance(one, Bead) else (other, one)
    like = hertz(bead, partner).potential  # type: ignore[arg-type]
    is_power = isinstance(law, PowerLaw) and law.exponent == like.exponent  # type: ignore[attr-defined]
    return is_power and abs(law.values[0] / like.values[0] - 1) <= SAME


def power(constant: float, exponent: float) -> ContactLaw:
    """A contact law with the same constant [N/m^n] and exponent n, both > 0, for every contact.

    It is passed as `law` to `chain`, `y_guide` or `diamond_guide`, in place of `hertz`.
    """
    contact = Contact(constant, exponent)
    return lambda bead, other: contact


def checked_law(law: ContactLaw) -> ContactLaw:
    """The contact law given to `chain` or a guide, checked to be callable."""
    if not callable(law):
        raise TensegrityError(
            f"law {check.shown(law)} is not a function of two partners, such as hertz"
        )
    return law


def contact_of(law: ContactLaw, bead: Bead, other: Bead | Material) -> Contact:
    """The contact of two partners under a contact law.

    Parameters
    ----------
    law : callable (Bead, Bead or Material) -> Contact
    bead : Bead
    other : Bead or Material
        A Material stands for a plane wall.

    Returns
    -------
    Contact

    Raises
    ------
    TensegrityError
        The law cannot be called with two partners, or does not return a Contact.
    """
    try:
        contact = law(bead, other)
    except TypeError as error:  # such as a wrong number of arguments
        raise TensegrityError(f"law {check.shown(law)} of two partners: {error}") from error
    check.kind("what the law gives to two partners", contact, Contact)
    own = type(contact)
    if own.potential is not Contact.potential and own.overlap is not Contact.overlap:
        load = -float(contact.potential.tension(-PROBE))
        found = contact.overlap(load) if load > 0 else PROBE
        if not abs(found - PROBE) <= SAME**0.5 * PROBE:
            raise TensegrityError(
                f"{own.__name__}: its overlap under {load:.6g} N is {found:.6g} m, "
                f"but its potential has this force at {PROBE:g} m"
            )
    return contact


def refuse_attraction(contact: Contact, what: str) -> None:
    """Refuse an attraction where a force is defined for compressive contacts only."""
    if contact.attracts:
        raise TensegrityError(
            f"a contact attracts and {what}: no model gives the force at which it parts, {contact}"
        )


def _constant(kind: str, *numbers: float) -> float:
    (constant,) = run(derived(_constants, kind), np, numbers)
    return float(constant)


def hertz_constants(modulus: Array, poisson: Array, radius: Array, *other: Array) -> Array:
    """Constants of many Hertz contacts at once.

    Parameters
    ----------
    modulus, poisson, radius : array_like
        Young's moduli [Pa], Poisson's ratios and radii of contact [m] of the beads, of shapes that
        broadcast.
    *other : array_like
        The same three quantities of their partners; the radius of a plane wall is inf.

    Returns
    -------
    ndarray, the broadcast shape
        [N/m^1.5], > 0.
    """
    modulus_2, poisson_2, radius_2 = other
    numbers = (modulus, modulus_2, poisson, poisson_2, radius, radius_2)
    (constants,) = run(derived(_constants, "pair"), np, numbers)
    return np.asarray(constants)


def hertz_slopes(*numbers: Array, by: str = "radius") -> tuple[Array, Array]:
    """Derivatives of `hertz_constants` with respect to the "radius" [N/m^2.5] or the "modulus"
    [N/(Pa m^1.5)] of the bead, and of its partner."""
    place = ("modulus", "poisson", "radius").index(by)
    steps = 1j * TINY * np.eye(6)[[place, place + 3]]
    moved = ([x + h if h else x for x, h in zip(numbers, step, strict=True)] for step in steps)
    one, other = (hertz_constants(*x).imag / TINY for x in moved)
    return one, other


def _constants(kind: str) -> tuple[list[Any], tuple[Any, ...]]:
    """alpha of two spheres, or of a sphere on a plane wall, and the symbols it depends on."""
    import sympy as sp

    from derivations import contact as form

    solids = (form.modulus_1, form.modulus_2, form.poisson_1, form.poisson_2)
    pair, exponent = form.hertz_constant()
    if exponent != sp.Rational(3, 2):
        raise TensegrityError(f"exponent {exponent} of the derived contact law must be 3/2")
    if kind == "wall":
        return [form.wall_constant()], (*solids, form.radius_1)
    return [pair], (*solids, form.radius_1, form.radius_2)


BY_BEADS = ("diameter", "modulus")


def by_beads(
    name: str,
    beads: Sequence[Bead],
    pairs: Sequence[tuple[int, int | Material]],
    springs: Sequence[Potential],
    by_constant: Array,
    by_mass: Array,
    by_gap: Array | None,
) -> Array:
    """Derivatives with respect to one of `BY_BEADS` of every bead.

    Parameters
    ----------
    name : str
    beads : sequence of Bead
    pairs : sequence of (int, int or Material)
        Partners of each contact: a bead and another, or the material of a wall.
    springs : sequence of Potential, (contacts,)
    by_constant, by_gap : ndarray, (contacts,)
        Derivatives by the contacts' constants and gaps; None where gaps stay.
    by_mass : ndarray, (sites,)

    Returns
    -------
    ndarray, shape of by_mass
        Per metre or per pascal.

    Raises
    ------
    TensegrityError
        A contact that is not Hertz's, whose constant does not say how it depends on beads.
    """
    check.kind("name", name, str)
    if name not in BY_BEADS:
        raise TensegrityError(f"name {check.shown(name)} is not one of {', '.join(BY_BEADS)}")
    by_bead, solids = np.zeros(by_mass.shape), []
    for k, (one, other) in enumerate(pairs):
        partner = other if isinstance(other, Material) else beads[other]
        if not is_hertz(springs[k], beads[one], partner):
            raise TensegrityError(
                f"contact {k}, {springs[k]!r}, is not Hertz's: it does not say how it depends on "
                f"the {name} of beads"
            )
        solids.append((*_solid(beads[one]), *_solid(partner)))
    by = {"diameter": "radius", "modulus": "modulus"}[name]
    both = np.transpose(hertz_slopes(*np.reshape(solids, (-1, 6)).T, by=by))
    for k, (pair, slopes) in enumerate(zip(pairs, both, strict=True)):
        for end, slope in zip(pair, slopes, strict=True):
            if isinstance(end, Material):
                continue
            if name == "modulus":
                by_bead[end] += by_constant[k] * slope
            elif beads[end].contact_radius == beads[end].radius:
                by_bead[end] += by_constant[k] * slope / 2
            if name == "diameter" and by_gap is not None:
                by_bead[end] -= by_gap[k] / 2
    if name == "diameter":
        for site, bead in enumerate(beads):
            by_bead[site] += by_mass[site] * mass_slope(bead)
    return by_bead


def _solid(body: Bead | Material) -> tuple[float, float, float]:
    """Modulus [Pa], Poisson's ratio and contact radius [m] of a bead or a wall."""
    if isinstance(body, Material):
        return body.modulus, body.poisson, math.inf
    return body.material.modulus, body.material.poisson, body.contact_radius


def mass_slope(bead: Bead) -> float:
    """Derivative of the mass of a bead in its diameter [kg/m], 0 where the mass was given."""
    density = bead.material.density
    if bead.mass != density * volume(bead.diameter):
        return 0.0
    return density * volume(complex(bead.diameter, TINY)).imag / TINY  # type: ignore[arg-type]
