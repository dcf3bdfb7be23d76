"""Static equilibrium of beads under gravity and other constant loads.

The set of contacts that carry is free: it is found with the forces and the stiffness of the scene
itself, by `tensegrity.minimum`.  Where Newton's step does not lower the energy, every contact has
besides, in part, the stiffness of a spring of its force over its overlap (contacts that only touch,
or are open, have none of their own), and less of the softness that its force lends across it.
Steps are short beside a radius, and a bead that goes farther than a tenth of one is said to fall:
what is looked for is the rest of the pack as it was laid, not where a heap ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.crystal import site_name
from tensegrity import EquilibriumError, minimum
from tensegrity.engine import forces
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from granular.assembly import Assembly
    from tensegrity.typing import Array

GUESS = 1e-6  # overlap of a contact that only touches, in radii, where its spring is asked for
FLOOR = 1e-3  # of the stiffest such spring: a contact that is open
LONGEST, FARTHEST = 0.02, 0.1  # radii: of one step, and of all
CARRIED = 1e-11  # of the sum of all loads: what may be left over


@dataclass(frozen=True, eq=False)
class Equilibrium(ReadOnly):
    """Beads at rest under their loads.

    Attributes
    ----------
    u : ndarray, (sites, dim)
        Displacements from the places as laid [m].
    residual : float
        Sum over all beads of the force that is left over [N].
    contacts : int
        Number of contacts that carry, those with walls included.
    """

    u: Array
    residual: float
    contacts: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", fixed(self.u))


def rest_of(scene: Assembly, **unstruck: Any) -> Equilibrium | None:
    """How the beads of a scene rest under their loads, the striker apart; None without loads.

    A scene with a striker is made again with these other arguments, without it.
    """
    if not np.any(scene.loads):
        return None
    if scene.striker is None:
        return settle(scene)
    made: Any = type(scene)(**scene._made_of | unstruck)
    return made.equilibrium


def settle(scene: Assembly) -> Equilibrium:
    """Where the beads of a scene come to rest under its loads.

    Raises
    ------
    EquilibriumError
        A bead has no support, or moves by more than a tenth of its radius.
    """
    of, total = _Listed(scene), np.abs(scene.loads).sum()
    u, f = minimum.settle(of, np.zeros(scene.shape), shift=1.0)
    left = float(np.abs(f).sum())
    if not left <= CARRIED * total:
        worst = int(np.argmax(np.abs(f).max(axis=1)))
        raise EquilibriumError(
            f"{site_name(scene, worst)} finds no rest under the loads: of these {left:.3g} N are "
            f"not carried, must be at most {CARRIED * total:.3g} N, {CARRIED:g} of them"
        )
    return Equilibrium(u, left, of.carrying(u))


class _Listed:
    """A scene with the contacts that it lists near the displacements it is asked about: a
    `minimum.Energy`."""

    def __init__(self, scene: Assembly) -> None:
        self._whole, self._at = scene, np.zeros(scene.shape)
        self._radius = np.array([bead.radius for bead in scene.beads])
        self.longest = LONGEST * self._radius
        of = dynamics(scene)
        self._listed: Any = of.listed(self._at)
        self._room = of.clearance.skin / 4 if of.follows else np.inf

    def _forces_at(self, u: Array) -> tuple[Any, Array, Array, Array]:
        """Dynamics with the contacts there, their elongations and directions, and tensions."""
        if np.abs(u - self._at).max() > self._room:
            self._listed, self._at = dynamics(self._whole).listed(u), u
        of = self._listed
        r, along = forces.elongations(of.contact_bonds, u)
        return of, r, along, of.springs.evaluate("tension", r)

    def forces(self, u: Array) -> Array:
        of, _, along, tension = self._forces_at(u)
        pull: Array = forces.scattered_forces(of.contact_bonds, tension, along)[: of.sites]
        return pull + self._whole.loads

    def energy(self, u: Array) -> tuple[float, float]:
        of, r, _, _ = self._forces_at(u)
        stored = float(of.springs.evaluate("energy", r).sum())
        work = float(np.sum(self._whole.loads * u))
        return stored - work, stored + abs(work)

    def largest(self, u: Array) -> float:
        return max(np.abs(self._forces_at(u)[-1]).max(initial=0.0), np.abs(self._whole.loads).max())

    def carrying(self, u: Array) -> int:
        """Number of contacts that carry."""
        return int(np.count_nonzero(self._forces_at(u)[-1]))

    def newton(self, u: Array, f: Array) -> Callable[[float], Array | None]:
        from scipy.sparse import eye_array

        of, r, along, tension = self._forces_at(u)
        bonds, table, rigid = of.contact_bonds, of.springs, np.zeros((f.size, 0))
        least = GUESS * self._radius.min()
        pressed = np.minimum(r, -least)
        secant = table.evaluate("tension", pressed) / pressed
        secant = np.where(r > least * GUESS, FLOOR * secant.max(initial=0.0), secant)
        own = forces.tangent(bonds, r, along, tension, table.evaluate("stiffness", r))
        added = forces.tangent(bonds, r, along, -tension, secant)

        def step(shift: float) -> Array | None:
            matrix = (own + shift * added).tocsc()[: f.size, : f.size]
            bare = 1e-12 * (np.abs(matrix.diagonal()).max(initial=0.0) or 1.0)  # what bears nothing
            move = minimum.downhill(matrix + bare * eye_array(f.size), rigid, f.ravel())
            return None if move is None else move.reshape(f.shape)

        return step

    def refuse(self, u: Array, f: Array) -> None:
        way = np.sqrt(np.sum(u**2, axis=1)) / (FARTHEST * self._radius)
        if not np.all(way < 1):
            site = int(np.argmax(np.nan_to_num(way, nan=np.inf)))
            raise EquilibriumError(
                f"{site_name(self._whole, site)} finds no rest under the loads: it moved "
                f"{np.linalg.norm(u[site]):.3g} m, must be below "
                f"{FARTHEST * self._radius[site]:.3g} m, a tenth of its radius, and "
                f"{np.linalg.norm(f[site]):.3g} N on it are not carried"
            )
