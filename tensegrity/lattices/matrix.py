"""The material around a lattice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict
from tensegrity.typing import Array, Indices


def images(points: Array, vectors: Array) -> tuple[Array, Indices]:
    """Points in the cells around, and the number of each.

    Parameters
    ----------
    points, vectors : ndarray, (points, dim) and (d, dim)

    Returns
    -------
    ndarray, (images, dim), and ndarray of int, (images,)
        Cell by cell, that of the points in the middle.
    """
    cells = np.array([*product((-2, -1, 0, 1, 2), repeat=len(vectors))])
    moved = (points + (cells @ vectors)[:, None]).reshape(-1, points.shape[1])
    return moved, np.tile(np.arange(len(points)), len(cells))


@checked
@dataclass(frozen=True)
class Matrix:
    """An isotropic, linearly elastic material around a lattice.

    Parameters
    ----------
    modulus : float
        Young's modulus [Pa], > 0; of plane lattices for 1 m of thickness.
    poisson : float
        Poisson's ratio, > -1 and < 0.5.
    density : float
        [kg/m^3], >= 0; > 0 for waves in a mesh.
    loss : float, optional
        Loss factor, the ratio of the imaginary part of the modulus to the real one.
    radius : float or dict, optional
        Of the rigid disc or ball, centred at a node, by which it is bonded [m]: one for all nodes,
        or {node: radius}; other nodes are not bonded and hang on their members.
    antiplane : bool, optional
        Whether the plane lattice and its matrix move out of the plane only, where members resist by
        their force densities; by default in the plane, without strain across it.

    Raises
    ------
    TensegrityError
        A number outside its bounds.

    Examples
    --------
    >>> from tensegrity import Matrix
    >>> round(Matrix(modulus=3.0, poisson=0.5, density=1.0, antiplane=True).shear, 3)
    1.0
    """

    modulus: Annotated[float, "> 0", "Pa"]
    poisson: Annotated[float, "> -1", "<= 0.5"]
    density: Annotated[float, ">= 0", "kg/m^3"]
    loss: Annotated[float, ">= 0"] = 0.0
    radius: float | Mapping[int, float] | None = None
    antiplane: bool = False

    def __post_init__(self) -> None:
        if self.poisson == 0.5 and not self.antiplane:
            raise TensegrityError(
                "poisson 0.5 must be below 0.5 in plane strain and in space: the bulk modulus is "
                "infinite there"
            )
        if isinstance(self.radius, Mapping):
            if not self.radius:
                raise TensegrityError("radius {} of the matrix must name 1 node or more")
            each = {check.whole("node of radius", n, least=0): r for n, r in self.radius.items()}
            object.__setattr__(self, "radius", FixedDict(each))
        for radius in self.radius.values() if isinstance(self.radius, Mapping) else [self.radius]:
            if radius is not None:
                check.number("radius", radius, above=0, unit="m")

    @property
    def shear(self) -> float:
        """Shear modulus [Pa]."""
        return self.modulus / (2 * (1 + self.poisson))

    @property
    def lame(self) -> float:
        """Lame's first constant [Pa]."""
        return 2 * self.shear * self.poisson / (1 - 2 * self.poisson)

    def _stiffness(self, dim: int) -> Array:
        """Stiffness C_ijkl [Pa] against gradients, (dim, dim, dim, dim); out of the plane (1, 2, 1,
        2)."""
        one = np.eye(dim)
        if self.antiplane:
            return self.shear * one[None, :, None, :]
        sheared = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
        return self.lame * np.einsum("ij,kl->ijkl", one, one) + self.shear * sheared

    def _radii(self, positions: Array, vectors: Array) -> dict[int, float]:
        """The bonded nodes and their radii [m], checked to be of nodes and to leave room."""
        from scipy.spatial import cKDTree

        given: dict[int, Any] = dict.fromkeys(range(len(positions)), self.radius)
        if isinstance(self.radius, Mapping):
            given = dict(self.radius)
        for node in given:
            check.whole("node of radius", node, least=0, below=len(positions))
        centres, owner = images(positions[[*given]], vectors)
        nearest = cKDTree(centres).query(positions[[*given]], k=2)
        for node, apart, other in zip(given, nearest[0][:, 1], nearest[1][:, 1], strict=True):
            if not given[node] < apart / 2:
                raise TensegrityError(
                    f"radius {given[node]:g} m of node {node} must be below half its distance "
                    f"{apart:.6g} m from node {[*given][owner[other]]}: patches may not overlap"
                )
        return given
