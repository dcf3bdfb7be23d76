"""Static equilibrium of beads under gravity and other constant loads.

The set of loaded contacts is unknown: it is found from the forces and the stiffness of the scene,
by `tensegrity.minimum`.  Where Newton's step does not lower the energy, a fraction of the secant
stiffness, force over overlap, is added to each contact (contacts that only touch, or are open, have
no tangent stiffness), and its destabilising geometric stiffness is reduced.  Steps are short
compared with a radius, and a displacement above a tenth of a radius is an error: the equilibrium
sought is that next to the initial configuration, not that of a collapsed heap.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.crystal import site_name
from tensegrity import EquilibriumError, minimum
from tensegrity.engine import forces
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs.pressed import rest_overlaps

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from granular.assembly import Assembly
    from tensegrity.typing import Array

GUESS = 1e-6  # overlap of a contact that only touches, in radii, where its spring is evaluated
FLOOR = 1e-3  # of the stiffest such spring: a contact that is open
LONGEST, FARTHEST = 0.02, 0.1  # radii: of one step, and of all
BARE = 1e-12  # stiffness of motions without any, over the largest
CARRIED = 1e-11  # of the sum of all loads: what may be left over


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(Printed, ReadOnly):
    """Beads at rest under their loads.

    Attributes
    ----------
    u : ndarray, (sites, dim)
        Displacements from the initial places [m].
    residual : float
        Sum over all beads of the unbalanced force [N].
    contacts : int
        Number of loaded contacts, including those with walls.
    """

    u: Array
    residual: float
    contacts: int

    def _lines(self) -> Lines:
        way = np.linalg.norm(self.u, axis=-1)
        yield (
            f"{len(self.u)} beads at rest under their loads: {self.contacts} contacts carry, "
            f"{self.residual:.1e} N are unbalanced"
        )
        yield f"  displacements up to {way.max():.6g} m, of site {int(way.argmax())}"

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", fixed(self.u))


def rest_of(scene: Assembly, attract: bool, **unstruck: Any) -> Equilibrium | None:
    """Static equilibrium of a scene without its striker; None without loads or attraction.

    A scene with a striker is rebuilt without it, with `unstruck` in place of its arguments.
    """
    if not (attract or np.any(scene.loads)):
        return None
    if scene.striker is None:
        return settle(scene)
    made: Any = type(scene)(**scene._arguments | unstruck)
    return made.equilibrium


def settle(scene: Assembly) -> Equilibrium:
    """Static equilibrium of the beads of a scene under its loads.

    Raises
    ------
    EquilibriumError
        A bead has no support, or moves by more than a tenth of its radius.
    """
    of = _Listed(scene)
    u, pulled = of.drawn_together()
    total = np.abs(scene.loads).sum() + pulled
    u, f = minimum.settle(of, u, shift=1.0)
    left = float(np.abs(f).sum())
    if not left <= CARRIED * total:
        worst = int(np.argmax(np.abs(f).max(axis=1)))
        raise EquilibriumError(
            f"{site_name(scene, worst)} finds no equilibrium under the loads: {left:.3g} N are "
            f"unbalanced, must be at most {CARRIED * total:.3g} N, {CARRIED:g} of the loads"
        )
    return Equilibrium(u, left, of.carrying(u))


class _Listed:
    """A scene with the contacts that it lists near given displacements: a
    `minimum.Energy`."""

    def __init__(self, scene: Assembly) -> None:
        self._whole = scene
        self._radius = np.array([bead.radius for bead in scene.beads])
        self.longest = LONGEST * self._radius
        of = dynamics(scene)
        self._list(np.zeros(scene.shape))
        self._room = of.clearance.skin / 4 if of.follows else np.inf

    def _list(self, u: Array) -> None:
        """List the contacts near displacements, with the overlap at rest [m] and the stiffness
        there [N/m] of those that attract."""
        of: Any = dynamics(self._whole).listed(u)
        self._listed, self._at, self._rest = of, u, rest_overlaps(of.springs)
        if self._rest.any():
            stiffness = of.springs.evaluate("stiffness", -self._rest)
            self._firm = np.where(self._rest > 0, stiffness, 0.0)

    def _forces_at(self, u: Array) -> tuple[Any, Array, Array, Array]:
        """Dynamics with the contacts there, their elongations and directions, and tensions."""
        if np.abs(u - self._at).max() > self._room:
            self._list(u)
        of = self._listed
        r, along = forces.elongations(of.contact_bonds, u)
        return of, r, along, of.springs.evaluate("tension", r)

    def drawn_together(self) -> tuple[Array, float]:
        """Displacements at which contacts that attract have, to first order, their overlap at rest,
        and the sum of the forces that this takes [N]."""
        from scipy.sparse import eye_array

        u = np.zeros(self._whole.shape)
        of, r, along, _ = self._forces_at(u)
        if not self._rest.any():
            return u, 0.0
        rest, k = self._rest, self._firm
        f = forces.scattered_forces(of.contact_bonds, k * rest, along)[: of.sites]
        matrix = forces.tangent(of.contact_bonds, r, along, 0 * r, k).tocsc()[: f.size, : f.size]
        bare = BARE * np.abs(matrix.diagonal()).max() * eye_array(f.size)
        move = minimum.downhill(matrix + bare, np.zeros((f.size, 0)), f.ravel())
        return u if move is None else move.reshape(f.shape), float((k * rest).sum())

    def forces(self, u: Array) -> Array:
        of, _, along, tension = self._forces_at(u)
        pull: Array = forces.scattered_forces(of.contact_bonds, tension, along)[: of.sites]
        return pull + self._whole.loads

    def energy(self, u: Array) -> tuple[float, float]:
        of, r, _, _ = self._forces_at(u)
        stored = of.springs.evaluate("energy", r)
        work = float(np.sum(self._whole.loads * u))
        return float(stored.sum()) - work, float(np.abs(stored).sum()) + abs(work)

    def largest(self, u: Array) -> float:
        return max(np.abs(self._forces_at(u)[-1]).max(initial=0.0), np.abs(self._whole.loads).max())

    def allowed(self, u: Array) -> float:
        return float(CARRIED * np.abs(self._whole.loads).sum())

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
        if self._rest.any():
            secant = np.where(self._rest > 0, self._firm, secant)
        own = forces.tangent(bonds, r, along, tension, table.evaluate("stiffness", r))
        added = forces.tangent(bonds, r, along, -tension, secant)

        def step(shift: float) -> Array | None:
            matrix = (own + shift * added).tocsc()[: f.size, : f.size]
            bare = BARE * (np.abs(matrix.diagonal()).max(initial=0.0) or 1.0)  # no stiffness
            move = minimum.downhill(matrix + bare * eye_array(f.size), rigid, f.ravel())
            return None if move is None else move.reshape(f.shape)

        return step

    def refuse(self, u: Array, f: Array) -> None:
        way = np.sqrt(np.sum(u**2, axis=1)) / (FARTHEST * self._radius)
        if not np.all(way < 1):
            site = int(np.argmax(np.nan_to_num(way, nan=np.inf)))
            raise EquilibriumError(
                f"{site_name(self._whole, site)} finds no equilibrium under the loads: it moved "
                f"{np.linalg.norm(u[site]):.3g} m, must be below "
                f"{FARTHEST * self._radius[site]:.3g} m, a tenth of its radius, and "
                f"{np.linalg.norm(f[site]):.3g} N on it are unbalanced"
            )
