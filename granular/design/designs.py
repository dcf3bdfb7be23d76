"""Chains of equally many beads as arrays, a row for each: what a search computes with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.contact import hertz_constants, hertz_slopes

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from granular.beads import Bead
    from granular.materials import Material
    from tensegrity.typing import Array


@dataclass(frozen=True, eq=False)
class Designs:
    """Chains of equally many beads, as arrays.

    Attributes
    ----------
    mass, modulus, poisson, radius : ndarray, (designs, beads)
        [kg], [Pa], 1, and of the contacts [m].
    """

    mass: Array
    modulus: Array
    poisson: Array
    radius: Array

    @classmethod
    def of(cls, chains: Sequence[Sequence[Bead]]) -> Designs:
        """Those of sequences of beads."""
        rows = [
            [(b.mass, b.material.modulus, b.material.poisson, b.contact_radius) for b in chain]
            for chain in chains
        ]
        return cls(*np.moveaxis(np.array(rows), -1, 0))

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, which: Any) -> Designs:
        return Designs(*(np.atleast_2d(x[which]) for x in self.columns))

    @property
    def columns(self) -> tuple[Array, Array, Array, Array]:
        """All four."""
        return self.mass, self.modulus, self.poisson, self.radius

    def behind(self, striker: Bead) -> Designs:
        """The same chains with the striker as first bead."""
        first = Designs.of([[striker]])
        return Designs(*(
            np.concatenate([np.broadcast_to(one, (len(self), 1)), all_], axis=1)
            for one, all_ in zip(first.columns, self.columns, strict=True)
        ))  # fmt: skip

    def contacts(self, wall: Material) -> Array:
        """Constants of the contacts, the wall's last [N/m^1.5]; (designs, beads)."""
        return hertz_constants(*self._partners(wall))

    def contact_slopes(self, wall: Material) -> tuple[Array, Array]:
        """Derivatives of these by the radius before and behind each contact [N/m^2.5]."""
        return hertz_slopes(*self._partners(wall))

    def _partners(self, wall: Material) -> tuple[Array, ...]:
        """What both sides of the contacts are made of, the wall's last."""
        solid = self.modulus, self.poisson, self.radius
        last = wall.modulus, wall.poisson, math.inf
        after = (np.append(x[:, 1:], np.full((len(self), 1), y), axis=1)
                 for x, y in zip(solid, last, strict=True))  # fmt: skip
        return *solid, *after

    def unit(self, wall: Material, speed: float) -> Array:
        """Time unit [s] of the fastest contact that the beads could make; (designs,)."""
        wall_as_bead = math.inf, wall.modulus, wall.poisson, math.inf
        mass, *solid = (
            np.append(x, np.full((len(self), 1), y), axis=1)[:, :, None]
            for x, y in zip(self.columns, wall_as_bead, strict=True)
        )
        other, *partner = (x[:, None, :] for x in self.columns)
        rate = ((1 / mass + 1 / other) * hertz_constants(*solid, *partner)) ** 2 * speed
        return rate.max(axis=(1, 2)) ** -0.2
