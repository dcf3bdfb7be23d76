"""Derivatives with respect to diameters and moduli of beads, by the chain rule.

The diameter of a bead enters its mass and the radius of its contacts, unless these were given
separately; for beads at fixed places, in a guide or a pack, it also enters the gaps.  The beads of
a chain touch whatever their diameters are.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular.beads import Bead, volume
from granular.contact import TINY, hertz_slopes, is_hertz
from granular.materials import Material
from tensegrity import TensegrityError, check

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tensegrity import Potential
    from tensegrity.typing import Array

NAMES = ("diameter", "modulus")


def by_beads(
    name: str,
    beads: Sequence[Bead],
    pairs: Sequence[tuple[int, int | Material]],
    springs: Sequence[Potential],
    by_constant: Array,
    by_mass: Array,
    by_gap: Array | None,
) -> Array:
    """Derivatives with respect to one of `NAMES` of every bead.

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
