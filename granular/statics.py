"""Static equilibrium of beads under gravity and other constant loads.

The set of contacts that carry is free: it is found with the forces and the stiffness of the scene
itself.  Newton's steps, where they lessen the forces that are left over; where they do not, steps
downhill in energy, in which every contact is a spring of its force over its overlap: contacts that
only touch, or are open, have no stiffness of their own.  Steps are short beside a radius, and a
bead that goes farther than a tenth of one is said to fall: what is looked for is the rest of the
pack as it was laid, not where a heap ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.crystal import site_name
from tensegrity import EquilibriumError, State
from tensegrity.engine import forces
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from typing import Any

    from granular.assembly import Assembly
    from tensegrity.typing import Array

GUESS = 1e-6  # overlap of a contact that only touches, in radii, where its spring is asked for
FLOOR = 1e-6  # of the stiffest spring: that of a contact that is open
STEPS, HALVES = 1000, 60
LONGEST, FARTHEST = 0.02, 0.1  # radii: of one step, and of all
ROUND_OFF = 1e-14  # of the largest force: less is not asked for
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


def settle(scene: Assembly) -> Equilibrium:
    """Where the beads of a scene come to rest under its loads.

    Raises
    ------
    EquilibriumError
        A bead has no support, or moves by more than a tenth of its radius.
    """
    total = np.abs(scene.loads).sum()
    listed = _Listed(scene)
    u = np.zeros(scene.shape)
    f = listed.forces(u)
    for _ in range(STEPS):
        _refuse_falling(scene, u, f)
        if np.abs(f).max() <= ROUND_OFF * listed.largest(u):
            break
        step = _clipped(listed.newton(u, f), listed.radius)
        there = listed.forces(u + step)
        if np.linalg.norm(there) < 0.5 * np.linalg.norm(f):
            u, f = u + step, there
            continue
        if np.abs(f).sum() <= CARRIED * total:
            break  # round-off: no step of Newton's helps any more
        step, here = _clipped(listed.downhill(u, f), listed.radius), listed.energy(u)
        for _ in range(HALVES):
            if listed.energy(u + step) < here:
                break
            step = step / 2
        else:
            break  # nothing lowers the energy any more: loads are beneath its round-off
        u, f = u + step, listed.forces(u + step)
    _refuse_falling(scene, u, f)
    left = float(np.abs(f).sum())
    if not left <= CARRIED * total:
        worst = int(np.argmax(np.abs(f).max(axis=1)))
        raise EquilibriumError(
            f"{site_name(scene, worst)} finds no rest under the loads: of these {left:.3g} N are "
            f"not carried, must be at most {CARRIED * total:.3g} N, {CARRIED:g} of them"
        )
    return Equilibrium(u, left, listed.carrying(u))


class _Listed:
    """A scene with the contacts that it lists near the displacements it is asked about."""

    def __init__(self, scene: Assembly) -> None:
        self._whole, self._at = scene, np.zeros(scene.shape)
        self.radius = radii(scene)
        of = dynamics(scene)
        self._listed: Any = of.listed(self._at)
        self._room = of.clearance.skin / 4 if of.follows else np.inf

    def _near(self, u: Array) -> Any:
        if np.abs(u - self._at).max() > self._room:
            self._listed, self._at = dynamics(self._whole).listed(u), u
        return self._listed

    def _pulled(self, u: Array) -> tuple[Any, Array, Array, Array]:
        of = self._near(u)
        r, along = forces.elongations(of.contact_bonds, u)
        return of, r, along, of.springs.evaluate("tension", r)

    def forces(self, u: Array) -> Array:
        """Forces on all sites, loads included [N]."""
        of, _, along, tension = self._pulled(u)
        pull: Array = forces.pulls(of.contact_bonds, tension, along)[: of.sites]
        return pull + of.scene.loads

    def energy(self, u: Array) -> float:
        return float(self._near(u).scene.energy(State(u, np.zeros_like(u))))

    def largest(self, u: Array) -> float:
        """The largest of all forces of contacts and loads [N]."""
        of, _, _, tension = self._pulled(u)
        return max(np.abs(tension).max(initial=0.0), np.abs(of.scene.loads).max())

    def carrying(self, u: Array) -> int:
        return int(np.count_nonzero(self._pulled(u)[-1]))

    def newton(self, u: Array, f: Array) -> Array:
        """The step of Newton's method under forces f; no number where there is none."""
        of, r, along, tension = self._pulled(u)
        k = of.springs.evaluate("stiffness", r)
        return self._solved(of, r, along, tension, k, f)

    def downhill(self, u: Array, f: Array) -> Array:
        """What f does to springs of each contact's force over its overlap."""
        of, r, along, _ = self._pulled(u)
        least = GUESS * self.radius.min()
        pressed = np.where(np.abs(r) <= least * GUESS, -least, np.minimum(r, 0.0))
        tension = of.springs.evaluate("tension", pressed)
        k = np.divide(tension, pressed, out=np.zeros_like(r), where=pressed < 0)
        k = np.maximum(k, FLOOR * k.max(initial=0.0))
        return self._solved(of, r, along, np.zeros_like(r), k, f)

    def _solved(self, of: Any, r: Array, along: Array, tension: Array, k: Array, f: Array) -> Array:
        from scipy.sparse import eye_array
        from scipy.sparse.linalg import splu

        found = forces.tangent(of.contact_bonds, r, along, tension, k).tocsc()
        matrix = found[: f.size, : f.size]
        least = 1e-13 * (np.abs(matrix.diagonal()).max(initial=0.0) or 1.0)  # of what bears nothing
        solved: Array = splu(
            (matrix + least * eye_array(f.size, format="csc")).tocsc(),
            permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.01,
        ).solve(f.ravel())  # fmt: skip
        return solved.reshape(f.shape)


def _clipped(step: Array, radius: Array) -> Array:
    """A step, shortened until no bead goes farther than a small part of its radius."""
    share = np.max(np.sqrt(np.sum(step**2, axis=1)) / (LONGEST * radius))
    return np.zeros_like(step) if np.isnan(share) else step / max(share, 1.0)


def _refuse_falling(scene: Assembly, u: Array, f: Array) -> None:
    way = np.sqrt(np.sum(u**2, axis=1)) / (FARTHEST * radii(scene))
    if not np.all(way < 1):
        site = int(np.argmax(np.nan_to_num(way, nan=np.inf)))
        raise EquilibriumError(
            f"{site_name(scene, site)} finds no rest under the loads: it moved "
            f"{np.linalg.norm(u[site]):.3g} m, must be below {FARTHEST * radii(scene)[site]:.3g} "
            f"m, a tenth of its radius, and {np.linalg.norm(f[site]):.3g} N on it are not carried"
        )


def radii(scene: Assembly) -> Array:
    """Radius of each bead [m], (sites,)."""
    return np.array([bead.radius for bead in scene.beads])
