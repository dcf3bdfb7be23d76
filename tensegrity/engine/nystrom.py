"""Explicit methods that sum accelerations at points inside a step."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine.schemes import GAIN, Method, row_of

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

    Matrix = tuple[Array, Array, Array, Array]  # xx, xv, vx, vv
    Rows = Iterable[Iterable[Any]]


@dataclass(frozen=True)
class Nystrom(Method):
    """An explicit Runge-Kutta-Nystrom method.

    Stage i evaluates a_i at u + nodes[i] dt v + dt^2 sum_j matrix[i][j] a_j; then
    u += dt v + dt^2 sum positions[j] a_j and v += dt sum velocities[j] a_j.

    Attributes
    ----------
    nodes, positions, velocities : tuple, (stages,)
    matrix : tuple of tuples, (stages, stages)
    """

    nodes: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    symplectic = reversible = False
    _slack = _bisected = GAIN

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_rows("nodes", "positions", "velocities")
        rows = check.sequence(f"matrix of {self.name!r}", self.matrix, "rows")
        self._set("matrix", tuple(row_of(f"matrix of {self.name!r}", row) for row in rows))

    def check(self) -> None:
        """Refuse rows that are no step of time dt of the order said, or of the kind said."""
        count = self.stages
        shape = {len(self.matrix), len(self.positions), len(self.velocities)}
        self._require(
            shape | {len(row) for row in self.matrix} == {count},
            f"matrix, positions and velocities must have {count} entries a row, as the nodes",
        )
        self._require_stages()
        self._require_sum("sum of the velocities", self.velocities, 1)
        if self.order > 1:
            turned = [a * b for a, b in zip(self.velocities, self.nodes, strict=True)]
            self._require_sum("sum of the positions", self.positions, 0.5)
            self._require_sum("sum of velocities times nodes", turned, 0.5)
        ahead = any(a for i, row in enumerate(self.matrix) for a in row[i:])
        self._require(
            not (self.explicit and ahead),
            "the matrix must be 0 on its diagonal and above for the method to be explicit",
        )

    @property
    def stages(self) -> int:
        """Force evaluations per step."""
        return len(self.nodes)

    def step_matrix(self, z: Array | float) -> Matrix:
        """Entries (xx, xv, vx, vv) of a step's matrix for (x, v/omega), z = dt * omega."""
        entries = []
        for x, v in ((1.0, 0.0), (0.0, 1.0)):
            slopes: list[Any] = []
            for node, row in zip(self.nodes, self.matrix, strict=True):
                place = x + node * z * v + sum(a * k for a, k in zip(row, slopes, strict=False))
                slopes.append(-(z**2) * place)
            moved = sum(b * k for b, k in zip(self.positions, slopes, strict=True))
            turned = sum(b * k for b, k in zip(self.velocities, slopes, strict=True))
            entries.append((x + z * v + moved, v + turned / z))
        (xx, vx), (xv, vv) = entries
        return xx, xv, vx, vv

    def _excess(self, z: Array) -> Array:
        """Beyond stability if positive: both eigenvalues are within the unit circle where the
        determinant is at most 1 and the trace at most 1 + determinant, in size."""
        xx, xv, vx, vv = self.step_matrix(z)
        determinant = xx * vv - xv * vx
        return np.maximum(np.abs(determinant) - 1, np.abs(xx + vv) - 1 - determinant)


def nystrom_of(matrix: Rows, weights: Iterable[Any]) -> dict[str, Any]:
    """Rows of the Nystrom form of a Runge-Kutta method, on (u, v)' = (v, a(u)).

    Its stages' velocities are v + dt sum_j matrix[i][j] a_j; put into the stages' positions they
    leave the square of the matrix, and likewise in the sum.
    """
    a, b = np.array(matrix, dtype=object), np.array(weights, dtype=object)
    return {
        "nodes": tuple(map(float, a.sum(axis=1))),
        "matrix": tuple(tuple(map(float, row)) for row in a @ a),
        "positions": tuple(map(float, b @ a)),
        "velocities": tuple(map(float, b)),
    }
