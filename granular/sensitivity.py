"""Derivatives by diameters and moduli of beads, from those by contacts and masses.

A bead's diameter is in its mass and in the radius of its contacts, where these were not given
apart; of beads at places of their own, in a guide or a pack, also in the gaps.  Beads of a chain
touch whatever their diameters are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granular.beads import Bead, volume
from granular.contact import Contact, hertz
from granular.materials import Material
from tensegrity import PowerLaw, TensegrityError, check
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tensegrity import Potential
    from tensegrity.typing import Array

NAMES = ("diameter", "modulus")
TINY = 1e-30  # step of a derivative through the complex plane


def by_beads(
    name: str,
    beads: Sequence[Bead],
    pairs: Sequence[tuple[int, int | Material]],
    springs: Sequence[Potential],
    by_constant: Array,
    by_mass: Array,
    by_gap: Array | None,
) -> Array:
    """Derivatives by one of `NAMES` of every bead.

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
    if name not in NAMES:
        raise TensegrityError(f"name {check.shown(name)} is not one of {', '.join(NAMES)}")
    found = np.zeros(by_mass.shape)
    for k, (one, other) in enumerate(pairs):
        partner = other if isinstance(other, Material) else beads[other]
        law, spring = hertz(beads[one], partner), springs[k]
        if not _is(spring, law):
            raise TensegrityError(
                f"contact {k}, {spring!r}, is not Hertz's: it does not say how it depends on the "
                f"{name} of beads"
            )
        ends = [one] if isinstance(other, Material) else [one, other]
        for end, slope in zip(ends, _slopes(name, beads[one], partner), strict=True):
            bead = beads[end]
            if name == "modulus":
                found[end] += by_constant[k] * slope
            elif bead.contact_radius == bead.radius:
                found[end] += by_constant[k] * slope / 2
            if name == "diameter" and by_gap is not None:
                found[end] -= by_gap[k] / 2
    if name == "diameter":
        for site, bead in enumerate(beads):
            found[site] += by_mass[site] * mass_slope(bead)
    return found


def _is(spring: Potential, law: Contact) -> bool:
    """Whether a spring has the law of a contact, whatever its preload."""
    if not isinstance(spring, PowerLaw):
        return False
    return (spring.parameters["stiffness"], spring.exponent) == (law.constant, law.exponent)


def mass_slope(bead: Bead) -> float:
    """Derivative of the mass of a bead by its diameter [kg/m], 0 where the mass was given."""
    density = bead.material.density
    if bead.mass != density * volume(bead.diameter):
        return 0.0
    return density * volume(complex(bead.diameter, TINY)).imag / TINY  # type: ignore[arg-type]


def _slopes(name: str, bead: Bead, partner: Bead | Material) -> list[float]:
    """Derivatives of Hertz's constant by the radius or the modulus of each bead."""
    pair, wall = _functions(name)
    one = bead.material
    if isinstance(partner, Material):
        return [
            wall(one.modulus, partner.modulus, one.poisson, partner.poisson, bead.contact_radius)
        ]
    two = partner.material
    given = one.modulus, two.modulus, one.poisson, two.poisson
    return list(pair(*given, bead.contact_radius, partner.contact_radius))


@once
def _functions(name: str) -> tuple[Callable[..., list[float]], Callable[..., float]]:
    import sympy as sp

    from derivations import contact as derived

    by = {"diameter": (derived.radius_1, derived.radius_2)}
    by["modulus"] = (derived.modulus_1, derived.modulus_2)
    solids = (derived.modulus_1, derived.modulus_2, derived.poisson_1, derived.poisson_2)
    pair, _ = derived.hertz_constant()
    wall = derived.wall_constant()
    return (
        sp.lambdify(
            (*solids, derived.radius_1, derived.radius_2),
            [sp.diff(pair, x) for x in by[name]], "math",
        ),
        sp.lambdify((*solids, derived.radius_1), sp.diff(wall, by[name][0]), "math"),
    )  # fmt: skip
