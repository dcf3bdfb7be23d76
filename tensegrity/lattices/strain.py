"""The energy of a cell under macroscopic strain, to be minimised."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tensegrity.errors import EquilibriumError
from tensegrity.lattices.cell import Cell
from tensegrity.minimum import downhill
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.members import FARTHEST, STEP
from tensegrity.typing import Array


@dataclass(frozen=True)
class Strained:
    """The energy of a cell over its nodes, and over its vectors too if they are free: a
    `minimum.Energy` of rows x."""

    cell: Cell
    free: bool

    @property
    def longest(self) -> float:
        return STEP * self.cell.span

    def energy(self, x: Array) -> tuple[float, float]:
        members = self.cell._members_at(x)
        pull = np.abs(members.tensions(x)).sum()
        return members.energy(x), float(pull * members.reach(x))

    def forces(self, x: Array) -> Array:
        members, rigid = self.cell._members_at(x), self.rigid(x)
        d, lengths = members.separations(x)
        pull = (members.stiffness * members.elongations(lengths) / lengths)[:, None] * d
        left = -(self.cell.incidence[:, : len(x)].T @ pull).ravel()
        return np.asarray(left - rigid @ (rigid.T @ left)).reshape(x.shape)

    def rigid(self, x: Array) -> Array:
        if not self.free:
            return self.cell.rigid_motions()
        nodes = self.cell.nodes
        return self.cell.at(x[:nodes], x[nodes:]).rigid_motions(strain=True)

    def largest(self, x: Array) -> float:
        return float(np.abs(self.cell._members_at(x).tensions(x)).max())

    def allowed(self, x: Array) -> float:
        return self.cell._members_at(x).unbalanced(x, self.largest(x))

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        from scipy.sparse import eye_array

        start = np.array_equal(x[: self.cell.nodes], self.cell.positions)
        tangent, rigid = self.cell._tangent(x, TAUT if start else 0.0), self.rigid(x)
        softest = float(self.cell.stiffnesses.min()) * eye_array(f.size)

        def step(shift: float) -> Array | None:
            move = downhill(tangent + shift * softest, rigid, f.ravel())
            return None if move is None else move.reshape(x.shape)

        return step

    def refuse(self, x: Array, f: Array) -> None:
        span = self.cell.span
        if np.ptp(x, axis=0).max() > FARTHEST * span:
            raise EquilibriumError(f"no equilibrium: the cell extends beyond {FARTHEST * span:g} m")
