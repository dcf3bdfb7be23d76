"""Inertia of a scene: masses of its sites, and the mass matrix of bonds with mass."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine import inertia
from tensegrity.readonly import fixed
from tensegrity.scenes.acting import per_coordinate
from tensegrity.typing import Array


class Inertia:
    """What the `Dynamics` of a scene says of masses."""

    scene: Any

    @cached_property
    def mass_matrix(self) -> Any:
        """Mass matrix of one direction [kg], (sites, sites), if bonds have mass; else None."""
        scene = self.scene
        if scene.bond_mass is None:
            return None
        bonds = scene.bonds[: len(scene.bond_mass)]  # others form
        return inertia.mass_matrix(scene.mass, bonds, scene.bond_mass)

    @cached_property
    def inverse(self) -> tuple[Array, Any]:
        """Inverse masses of the compiled loop, and the operations on forces before these; see
        `engine.inertia.inverse`."""
        scene = self.scene
        if self.mass_matrix is None:
            return self.inverse_mass, None
        free = np.ones(scene.shape, dtype=bool)
        free[list(scene.held)] = False
        for site, drive in scene.drive.items():
            free[site] &= not drive.prescribes or [one is None for one in drive.signals]
        weights, operations = inertia.inverse(self.mass_matrix, free)
        weights[list(scene.held)] = 0
        return fixed(weights), operations

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site, (sites,); if bonds have mass upper bounds of M^-1."""
        w = 1 / self.scene.mass if self.mass_matrix is None else self.inverse[1].mobility.copy()
        w[list(self.scene.held)] = 0
        return fixed(w)

    @property
    def diagonal_mass(self) -> Array:
        """Diagonal of the mass matrix [kg], (sites,)."""
        return self.scene.mass if self.mass_matrix is None else self.mass_matrix.diagonal()

    @property
    def row_mass(self) -> Array:
        """Sums of its rows [kg], (sites,): at each site, and half of each bond there."""
        return self.scene.mass if self.mass_matrix is None else self.mass_matrix.sum(axis=1)

    def momenta(self, v: Array) -> Array:
        """Momentum of each coordinate [kg m/s] at velocities (..., *shape of the scene) [m/s]."""
        if self.mass_matrix is None:
            return per_coordinate(self.scene, self.scene.mass) * v
        sites_first = np.moveaxis(v, -2, 0)
        each = self.mass_matrix @ sites_first.reshape(len(sites_first), -1)
        return np.moveaxis(each.reshape(sites_first.shape), 0, -2)

    def kinetic(self, v: Array) -> Array:
        """Kinetic energy of each coordinate [J] at velocities (..., *shape of the scene) [m/s]; of
        one at a bond with mass it may be below 0, the sum is not."""
        if self.mass_matrix is None:
            return 0.5 * per_coordinate(self.scene, self.scene.mass) * v**2
        return 0.5 * v * self.momenta(v)
