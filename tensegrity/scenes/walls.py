"""Plane walls: pieces of a line or of a plane that stand still."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tensegrity.typing import Array

SQUARE = 1e-9  # cosine of the angle of directions that pass as perpendicular


def floats(name: str, value: ArrayLike) -> Array:
    """A copy of `value` as a float array."""
    return np.array(check.floats(name, value))


@dataclass(frozen=True, eq=False)
class Wall(ReadOnly):
    """A flat wall, unbounded or a piece.

    Parameters
    ----------
    point : array_like, (dim,)
        A point of it [m]: the middle of a piece.
    normal : array_like, (dim,)
        Direction towards the side where the sites are; its length does not matter.
    extent : array_like, (dim - 1, dim) or, in the plane, (2,), optional; none on a line
        From the middle to the edges [m]: the half sides of a piece, perpendicular to the normal
        and to each other.  By default the wall has no end.
    """

    point: Array
    normal: Array
    extent: Array | None = None

    if TYPE_CHECKING:  # what converts is taken, arrays are kept

        def __init__(
            self, point: ArrayLike, normal: ArrayLike, extent: ArrayLike | None = None
        ) -> None: ...

    def __post_init__(self) -> None:
        point = floats("wall point", self.point)
        if point.shape not in ((1,), (2,), (3,)):
            raise TensegrityError(f"wall point has shape {point.shape}, must be (1,), (2,) or (3,)")
        check.vector("wall point", point, point.shape)
        normal = check.vector("wall normal", floats("wall normal", self.normal), point.shape)
        length = np.linalg.norm(normal)
        if length == 0:
            raise TensegrityError("wall normal has length 0")
        object.__setattr__(self, "point", fixed(point))
        object.__setattr__(self, "normal", fixed(normal / length))
        if self.extent is None:
            return
        extent = np.atleast_2d(floats("wall extent", self.extent))
        check.vector("wall extent", extent, (point.size - 1, point.size))
        sides = np.linalg.norm(extent, axis=1)
        if not np.all(sides > 0):
            raise TensegrityError(f"wall extent {sides} m must be above 0")
        unit = np.vstack([extent / sides[:, None], self.normal])
        if np.max(np.abs(unit @ unit.T - np.eye(len(unit)))) > SQUARE:
            raise TensegrityError("wall extent is not perpendicular to the normal and to itself")
        object.__setattr__(self, "extent", fixed(extent))

    @classmethod
    def between(cls, start: ArrayLike, stop: ArrayLike, side: ArrayLike) -> Wall:
        """The wall in the plane from one point to another [m], facing the point `side`."""
        start, stop, side = (floats("point of a wall", x) for x in (start, stop, side))
        if {start.shape, stop.shape, side.shape} != {(2,)}:
            raise TensegrityError("a wall between points of the plane needs three of shape (2,)")
        half = (stop - start) / 2
        normal = np.array([-half[1], half[0]])
        if normal @ (side - start) < 0:
            normal = -normal
        return cls(start + half, normal, half)

    def height(self, x: Array) -> Array:
        """Distance of points x (..., dim) from the wall's plane [m], > 0 on the normal's side."""
        return (check.rows("points", x, self.point.shape) - self.point) @ self.normal

    def overhang(self, x: Array) -> Array:
        """How far the foot of points x (..., dim) lies beyond the nearest edge [m]; < 0 inside."""
        x = check.rows("points", x, self.point.shape)
        if self.extent is None:
            return np.full(np.shape(x)[:-1], -np.inf)
        sides = np.linalg.norm(self.extent, axis=1)
        along = np.abs((x - self.point) @ (self.extent / sides[:, None]).T)
        return np.max(along - sides, axis=-1)

    def distance(self, x: Array) -> Array:
        """Distance of points x (..., dim) from the nearest point of the wall [m]."""
        x = check.rows("points", x, self.point.shape)
        height = self.height(x)
        if self.extent is None:
            return np.abs(height)
        sides = np.linalg.norm(self.extent, axis=1)
        along = np.abs((x - self.point) @ (self.extent / sides[:, None]).T)
        beyond = np.maximum(along - sides, 0)
        return np.sqrt(height**2 + np.sum(beyond**2, axis=-1))
