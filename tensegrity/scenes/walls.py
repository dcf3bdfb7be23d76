"""Rigid walls at rest: a plane (a line in two dimensions) or a rectangular piece of it,
with the distances of points from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed
from tensegrity.readonly import ReadOnly, fixed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Indices

PERPENDICULAR = 1e-9  # largest cosine of the angle of directions accepted as perpendicular


def floats(name: str, value: ArrayLike) -> Array:
    """A copy of `value` as a float array."""
    return np.array(check.floats(name, value))


@dataclass(frozen=True, eq=False)
class Wall(ReadOnly):
    """A flat wall, unbounded or bounded.

    Parameters
    ----------
    point : array_like, (dim,)
        A point of the wall [m]; of a bounded wall its centre.
    normal : array_like, (dim,)
        Direction towards the side of the sites, of any length above 0.
    extent : array_like, (dim - 1, dim) or, in the plane, (2,), optional
        Vectors from the centre to the edges [m]: half the sides of a bounded wall, perpendicular
        to the normal and to each other.  By default the wall is unbounded, as it must be on a line.

    Raises
    ------
    TensegrityError
        Shapes that do not agree, a normal or an extent of length 0, or directions that are not
        perpendicular.

    Examples
    --------
    A floor, and its distance from a point above it:

    >>> import numpy as np
    >>> from tensegrity import Wall
    >>> floor = Wall(point=(0, 0), normal=(0, 1))
    >>> float(floor.distance(np.array([1.0, 0.25])))
    0.25
    """

    point: Array
    normal: Array
    extent: Array | None = None

    __str__ = printed(point="m", extent="m")

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
        if np.max(np.abs(unit @ unit.T - np.eye(len(unit)))) > PERPENDICULAR:
            raise TensegrityError("wall extent is not perpendicular to the normal and to itself")
        object.__setattr__(self, "extent", fixed(extent))

    @classmethod
    def between(cls, start: ArrayLike, stop: ArrayLike, side: ArrayLike) -> Wall:
        """The wall in the plane between two points.

        Parameters
        ----------
        start, stop : array_like, (2,)
            The ends of the wall [m].
        side : array_like, (2,)
            A point on the side of the sites [m].

        Returns
        -------
        Wall

        Raises
        ------
        TensegrityError
            A point that is not in the plane, or two ends that coincide.
        """
        start, stop, side = (floats("point of a wall", x) for x in (start, stop, side))
        if {start.shape, stop.shape, side.shape} != {(2,)}:
            raise TensegrityError("a wall between points of the plane needs three of shape (2,)")
        half = (stop - start) / 2
        normal = np.array([-half[1], half[0]])
        if normal @ (side - start) < 0:
            normal = -normal
        return cls(start + half, normal, half)

    def height(self, x: Array) -> Array:
        """Signed distance of points x (..., dim) from the wall's plane [m], > 0 on the side to
        which the normal points; (...)."""
        return self._evaluate("height", x)

    def overhang(self, x: Array) -> Array:
        """Distance by which the projection of points x (..., dim) on the plane lies beyond the edge
        of the wall [m], < 0 inside; (...)."""
        return self._evaluate("overhang", x)

    def distance(self, x: Array) -> Array:
        """Distance of points x (..., dim) from the nearest point of the wall [m]; (...)."""
        return self._evaluate("distance", x)

    def _evaluate(self, name: str, x: Array) -> Array:
        x = check.rows("points", x, self.point.shape)
        arrays = WallArrays((self,), self.point.size)
        return getattr(arrays, name)(x[..., None, :], np.zeros(1, dtype=int))[..., 0]


class WallArrays:
    """Several walls as arrays; all methods take points x (..., n, dim) and the index of the wall of
    each point, (n,), and return (..., n)."""

    def __init__(self, walls: Sequence[Wall], dim: int) -> None:
        self._point = np.array([wall.point for wall in walls]).reshape(-1, dim)
        self._normal = np.array([wall.normal for wall in walls]).reshape(-1, dim)
        self._along = np.zeros((len(walls), dim - 1, dim))
        self._sides = np.full((len(walls), dim - 1), np.inf)
        for row, wall in enumerate(walls):
            if wall.extent is not None:
                self._sides[row] = np.linalg.norm(wall.extent, axis=1)
                self._along[row] = wall.extent / self._sides[row][:, None]

    def height(self, x: Array, numbers: Indices) -> Array:
        """Signed distances from the planes [m], > 0 on the side of the normal."""
        return np.einsum("...d,...d", x - self._point[numbers], self._normal[numbers])

    def feet(self, x: Array, numbers: Indices) -> Array:
        """The nearest points of the planes [m], (..., n, dim)."""
        return x - self.height(x, numbers)[..., None] * self._normal[numbers]

    def _beyond(self, x: Array, numbers: Indices) -> Array:
        away = (x - self._point[numbers])[..., None, :]
        return np.abs(np.einsum("...d,...d", away, self._along[numbers])) - self._sides[numbers]

    def overhang(self, x: Array, numbers: Indices) -> Array:
        """Distances by which the projections lie beyond the edges [m], < 0 inside."""
        if not np.isfinite(self._sides).any():
            return np.full(np.broadcast_shapes(x.shape[:-1], numbers.shape), -np.inf)
        return np.max(self._beyond(x, numbers), axis=-1, initial=-np.inf)

    def distance(self, x: Array, numbers: Indices) -> Array:
        """Distances from the nearest points of the walls [m], >= 0."""
        if not np.isfinite(self._sides).any():
            return np.abs(self.height(x, numbers))
        beyond = np.maximum(self._beyond(x, numbers), 0)
        return np.sqrt(self.height(x, numbers) ** 2 + np.sum(beyond**2, axis=-1))
