"""Springs between the sites of a chain and the ground: forces that have an energy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.scenes.force import Force
from tensegrity.springs.potential import Potential
from tensegrity.springs.provenance import range_error

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array


def on_site_springs(ground: Any, sites: int) -> list[Force]:
    """Springs between the sites of a chain and the ground, as forces.

    Parameters
    ----------
    ground : Potential, sequence of Potential, or None
        One for all sites, or one for each.
    sites : int

    Returns
    -------
    list of Force
        One for each law and domain.

    Raises
    ------
    TensegrityError
        Neither of these, or another number of springs.
    """
    if ground is None or isinstance(ground, Potential):
        return [] if ground is None else [Force(ground)]
    springs = check.sequence("ground", ground, "potentials")
    if len(springs) != sites:
        raise TensegrityError(f"{len(springs)} springs to the ground for {sites} sites")
    groups: dict[Any, list[int]] = {}
    for site, one in enumerate(springs):
        check.kind(f"spring to the ground of site {site}", one, Potential)
        groups.setdefault((one.law, one.domain, one.numbers.tobytes()), []).append(site)
    return [
        Force(springs[at[0]], at=at, parameters={
            name: [springs[site].parameters[name] for site in at]
            for name in springs[at[0]].parameters
        })
        for at in groups.values()
    ]  # fmt: skip


def on_site(scene: Any, order: int, u: Array) -> Array:
    """Energies [J] of the springs to the ground, or their derivatives of a given order in u.

    Parameters
    ----------
    scene : Scene
    order : int
    u : ndarray, (..., *shape of the scene)
        Displacements [m].

    Returns
    -------
    ndarray, shape of u

    Raises
    ------
    LockingError
        A displacement outside the domain of its spring.
    """
    values = np.zeros(u.shape)
    at_sites, sites = (x.reshape(*u.shape[: u.ndim - len(scene.shape)], -1) for x in (values, u))
    for one in scene._forces:
        if one.stores:
            applied, (low, high) = one._applied(scene), one.expression.domain
            at = sites[..., applied.places]
            if ((at <= low) | (at >= high)).any():
                outside = at[(at <= low) | (at >= high)]
                raise range_error(one.expression, float(outside.flat[0]))
            at_sites[..., applied.places] += applied.stored(order, sites)
    return values


def per_coordinate(scene: Any, values: Array) -> Array:
    """Values of sites, or of their coordinates, for each coordinate; shape of the scene."""
    one = values.reshape(*values.shape, *[1] * (len(scene.shape) - values.ndim))
    return np.broadcast_to(one, scene.shape)
