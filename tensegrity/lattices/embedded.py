"""A lattice embedded in a matrix: both add to the energy of a cell.

Without a mesh the matrix follows the macroscopic gradient (bonded everywhere, long waves): its
tangent and density add to those of the lattice.  With a mesh each bonded node is a rigid disc or
ball in finite elements: a vertex in a patch moves by T of the node's displacement and rotation, and
the coordinates of a cell are those of the nodes, the patches' rotations times their radii [m], and
the free vertices, with stiffness T^H (K_members + K_matrix) T.  The mass of a bonded node is spread
evenly over its patch.

The matrix is cast free of stress about the state of the lattice.  What follows, such as the release
of the stress that was held from outside while casting, is linear: the members have their elastic
stiffness, and the geometry stays as cast; the new tensions, and the stress of the matrix, are then
part of the state whose waves and moduli are asked for.
Source: T. L. Hill in Collar & Simpson 1987, Matrices and Engineering Dynamics, for rigid parts
in elastic ones; Ungar & Kerwin 1962, Loss factors of viscoelastic systems in terms of energy
concepts, for losses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bloch import BlochMatrix
from tensegrity.lattices.cell import Cell
from tensegrity.lattices.matrix import Matrix
from tensegrity.lattices.mesh import Body, meshed
from tensegrity.lattices.moduli import Stability, moduli, motions_under_gradients, stability
from tensegrity.lattices.periodic import (
    Assembly,
    Entries,
    Medium,
    UnderGradients,
    members_under_gradients,
)
from tensegrity.minimum import DENSE
from tensegrity.printing import Lines, Printed, span
from tensegrity.typing import Array, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GYRATION = {2: 1 / 2, 3: 2 / 5}  # square of the radius of gyration of discs and balls, of radius 1


@dataclass(frozen=True, eq=False, repr=False)
class Embedded(Medium, Printed):
    """A lattice in a matrix, made by `Lattice.embedded`; for `bands`, `moduli`, `decay` and
    `effective_mass`.

    Attributes
    ----------
    lattice : Lattice
        Where it was cast, with its tensions of now.
    matrix : Matrix
    body : Body, or None
        The mesh of the matrix.
    strain : ndarray, (dim, dim)
        Macroscopic strain since the casting.
    """

    lattice: Cell
    matrix: Matrix
    body: Body | None
    strain: Array

    def _lines(self) -> Lines:
        of = "bonded everywhere" if self.body is None else f"{self._unknowns[0]} coordinates a cell"
        yield f"{self.lattice} in a matrix of {self.matrix.modulus:g} Pa, {of}"
        pulled = float(np.abs(self.lattice.stress).max())
        yield f"  tensions {span(self.lattice.tensions, 'N')}"
        yield f"  mean stress of the matrix {span(self.matrix_stress, 'Pa', pulled)}"

    @property
    def cell(self) -> Cell:
        """The lattice."""
        return self.lattice

    @property
    def vectors(self) -> Array:  # type: ignore[override]
        """Lattice vectors [m], (d, dim)."""
        return self.lattice.vectors

    @property
    def components(self) -> int:
        """Components of a displacement: 1 out of the plane."""
        return 1 if self.matrix.antiplane else self.lattice.dim

    @property
    def share(self) -> float:
        """Volume of the matrix over that of the cell; 1 without a mesh."""
        return 1.0 if self.body is None else self.body.volume / self.lattice.size

    @property
    def density(self) -> float:
        """Mass of lattice and matrix over the size of a cell [kg/m^d]."""
        return super().density + self.matrix.density * self.share

    @property
    def matrix_stress(self) -> Array:
        """Mean over the cell of the stress of the matrix [Pa], (dim, dim); tension > 0."""
        if self.body is None and self.strain.any():
            return np.einsum("ijkl,kl->ij", self.matrix._stiffness(len(self.strain)), self.strain)
        if self.body is None or self.body.moved is None:
            return 0 * self.strain
        pull = self.body.gradients.T @ (self.body.elastic @ self.body.moved)
        return np.asarray(pull.reshape(self.strain.shape) / self.lattice.size)

    @property
    def stress(self) -> Array:
        """Macroscopic stress of lattice and matrix [Pa], (dim, dim); tension > 0."""
        return self.lattice.stress + self.matrix_stress

    def _coordinates(self) -> tuple[Indices, Indices]:
        """The node of each coordinate of a cell, or -1, and its axis, or -1, (size,)."""
        if self.body is not None:
            return self.body.coordinates
        nodes, axes = np.indices((self.lattice.nodes, self.components))
        return nodes.ravel(), axes.ravel()

    @property
    def _unknowns(self) -> tuple[int, int]:
        """The coordinates of a cell, one by one."""
        return len(self._coordinates()[0]), 1

    @property
    def blocks(self) -> Array:
        """Tangent stiffness of each member [N/m], (members, components, components)."""
        if self.matrix.antiplane:
            return self.lattice.densities[:, None, None]
        return self.lattice.blocks

    def refuse_unbalanced(self) -> None:
        """Refuse nothing: it was in equilibrium as it was cast."""

    def _assembly(self) -> Assembly:
        """Stiffness, masses of the coordinates, and the inertia of matrix and members."""
        self._meshed  # noqa: B018
        return self._parts

    @property
    def _meshed(self) -> Body:
        if self.body is None:
            raise TensegrityError(
                "a matrix that is bonded everywhere has moduli only, without waves shorter than "
                "the long ones: give `radius` of the Matrix and `mesh`"
            )
        return self.body

    @cached_property
    def _parts(self) -> Assembly:
        stiffness, mass, heavy = self.lattice._assembly(self.blocks)
        if self.body is None:
            return stiffness, mass, [*heavy, Entries.diagonal(0 * mass, len(self.vectors))]
        node, axis = self.body.coordinates
        turned = self.lattice.mass[node] * GYRATION[self.lattice.dim]
        inertia = np.where(axis < 0, turned, np.where(node < 0, 0, self.lattice.mass[node]))
        stiff, more = (self.body.entries(k) for k in (self.body.stiffness, self.body.inertia))
        return [*stiffness, stiff], inertia, [*heavy, more]

    @property
    def _affine(self) -> bool:
        """Whether there are no waves but long ones."""
        return self.body is None

    @property
    def _lossy(self) -> bool:
        """Whether the matrix has losses."""
        return self.matrix.loss > 0

    def _loss_factors(self, q: Array, squares: Array, shapes: Any) -> Array:
        """Loss factors of waves, by the elastic energy of the matrix."""
        u = self._meshed.displacements(q, shapes)
        energy = np.einsum("vb,vb->b", u.conj(), self._meshed.elastic @ u).real
        moving = (squares > 0) & (energy > 0)
        return self.matrix.loss * np.where(moving, energy / np.where(moving, squares, 1.0), 0.0)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The members of a cell, its patches as circles (in space, dots), and in the plane its
        mesh.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            With projection "3d" in space; by default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from matplotlib.collections import LineCollection
        from matplotlib.patches import Circle

        lattice = self.lattice
        drawn: Axes = plotting.axes(ax, in_space=lattice.dim == 3)
        first = lattice.positions[lattice.ends[:, 0]]
        ends = np.concatenate([first, first + lattice.members.separations(lattice.positions)[0]])
        pairs = np.arange(len(ends)).reshape(2, -1).T
        plotting.members(drawn, ends, pairs, lattice.is_string, lattice.slack, lattice.tensions)
        factor, _ = plotting.metres(np.ptp(ends, axis=0).max())
        if self.body is None:
            return drawn
        bonded = factor * lattice.positions[[*self.body.radii]]
        if lattice.dim == 3:
            drawn.scatter(*bonded.T, color="0.6")
            return drawn
        mesh = self.body.mesh
        lines = factor * mesh.p.T[mesh.facets.T]
        drawn.add_collection(LineCollection(lines, colors="0.8", linewidths=0.5, zorder=0))
        for centre, radius in zip(bonded, self.body.radii.values(), strict=True):
            drawn.add_patch(Circle(tuple(centre), factor * radius, color="0.6", zorder=1))
        drawn.autoscale_view()
        return drawn

    def _under_gradients(self) -> UnderGradients:
        """What macroscopic gradients do to a cell."""
        of = members_under_gradients(self.lattice, self.blocks)
        if self.body is None:
            under_stress = np.einsum("ik,jl->ijkl", np.eye(self.components), self.matrix_stress)
            affine = self.matrix._stiffness(self.lattice.dim) + under_stress
            affine = self.lattice.size * affine.reshape(of.whole.shape)
            return of._replace(whole=of.whole + affine, sizes=of.sizes + np.abs(affine).diagonal())
        body, more = self.body, self._unknowns[0] - len(of.forces)
        pull, size = body.stiffness @ body.gradients, np.abs(body.gradients)
        forces, largest = (np.pad(one, ((0, more), (0, 0))) for one in (of.forces, of.largest))
        forces += body.alike.T @ pull
        largest += np.abs(body.alike).T @ (np.abs(body.stiffness) @ size)
        whole = of.whole + body.gradients.T @ pull
        sizes = of.sizes + np.einsum("vg,vg->g", size, np.abs(body.stiffness) @ size)
        return UnderGradients(forces, largest, whole, sizes)

    def _at_rest(self) -> tuple[Any, Any]:
        """Stiffness [N/m] and inertia [kg] of motions that are alike in all cells; sparse where
        cells have many coordinates."""
        matrix = BlochMatrix.of(*self._parts, sparse=self._unknowns[0] > DENSE)
        alike = np.ones(len(matrix.offsets))
        return matrix.at(alike).real, matrix.at(alike, matrix.inertia).real

    def stability(self) -> Stability:
        """Whether it is stable about its own state; see `Lattice.stability`.

        Returns
        -------
        Stability
            Without a mesh by long waves and uniform strain, and `wave` is infinite.
        """
        return stability(self)

    # the state

    def strained(self, strain: ArrayLike) -> Embedded:
        """Under a further macroscopic strain, to first order in it: tensions and stress of the
        matrix change by the tangent stiffness, the geometry stays that of the casting.

        Parameters
        ----------
        strain : array_like, (dim, dim)
            Symmetric.

        Returns
        -------
        Embedded

        Raises
        ------
        TensegrityError
            The strain is not symmetric, or the matrix moves out of the plane only.
        EquilibriumError
            A string would slacken, or a bar buckle: the change is then no longer linear.
        """
        e = check.vector("strain", strain, self.strain.shape)
        if not np.allclose(e, e.T, rtol=1e-12, atol=0):
            raise TensegrityError(f"strain {check.shown(e.tolist())} must be symmetric")
        if self.matrix.antiplane:
            raise TensegrityError("antiplane True must be False for a strain in the plane")
        return self._moved(e, self)

    def _moved(self, e: Array, about: Embedded) -> Embedded:
        """Under a further strain, by the stiffness of some state."""
        lattice = self.lattice
        motions = motions_under_gradients(about)[1] @ -e.ravel()
        u = motions[: lattice.positions.size].reshape(lattice.positions.shape)
        d, lengths = lattice.members.separations(lattice.positions)
        (i, j), taut = lattice.ends.T, ~lattice.slack
        stretch = np.einsum("mk,mk->m", d @ e + u[j] - u[i], d) / lengths
        tensions = lattice.tensions + taut * lattice.stiffnesses * stretch
        natural = np.where(
            taut, lattice.lengths - tensions / lattice.stiffnesses, lattice.natural_lengths
        )
        after = _with(lattice, natural)
        for member in np.flatnonzero(after.slack & taut | after.buckled & ~lattice.buckled):
            raise EquilibriumError(
                f"{lattice.name_of(int(member))} would slacken or buckle: its tension goes from "
                f"{lattice.tensions[member]:.6g} to {tensions[member]:.6g} N"
            )
        body = self.body
        if body is not None:
            moved = body.alike @ motions + body.gradients @ e.ravel()
            body = replace(body, moved=moved if body.moved is None else moved + body.moved)
        return replace(self, lattice=after, body=body, strain=self.strain + e)

    def released(self) -> Embedded:
        """Without stress from outside: strained so that the macroscopic stress is 0, by the elastic
        stiffness of the members that are taut and of the matrix."""
        lattice, body = self.lattice, self.body
        natural = np.where(lattice.slack, lattice.natural_lengths, lattice.lengths)
        body = None if body is None else replace(body, moved=None)
        elastic = Embedded(_with(lattice, natural), self.matrix, body, 0 * self.strain)
        row, column = np.triu_indices(len(self.strain))
        c, twice = moduli(elastic).tangent, np.where(row == column, 1.0, 2.0)
        upper = np.linalg.solve(
            c[row[:, None], column[:, None], row, column] * twice, -self.stress[row, column]
        )
        strain = 0 * self.strain
        strain[row, column] = strain[column, row] = upper
        return self._moved(strain, elastic)


def _with(lattice: Cell, natural: Array) -> Cell:
    """A lattice of the same stiffnesses and other natural lengths [m]."""
    stiff, bars = lattice.stiffnesses, lattice.bars
    return lattice.at(
        lattice.positions, natural_lengths=natural, k_bar=stiff[:bars], k_string=stiff[bars:]
    )


def embedded(lattice: Cell, matrix: Matrix, cast: str, mesh: Any) -> Embedded:
    """A lattice in a matrix, cast about its state.

    Parameters
    ----------
    lattice : Cell
    matrix : Matrix
    cast : {"prestressed", "released"}
    mesh : optional
        As of `Lattice.embedded`.

    Returns
    -------
    Embedded

    Raises
    ------
    TensegrityError, EquilibriumError
        As of `Lattice.embedded`.
    """
    d = len(lattice.vectors)
    if d < lattice.dim:
        raise TensegrityError(f"{d} lattice vectors in {lattice.dim} dimensions: a matrix fills "
                              f"the space, must be {lattice.dim}")  # fmt: skip
    if matrix.antiplane and lattice.dim == 3:
        raise TensegrityError("antiplane True is of plane lattices, must be False in space")
    if matrix.antiplane and cast == "released":
        raise TensegrityError("cast 'released' strains the plane, must be 'prestressed' out of it")
    lattice.refuse_unbalanced()
    body = None
    if mesh is not None and matrix.radius is None:
        raise TensegrityError(
            "radius of the matrix is missing beside `mesh`: a node at a single vertex has no "
            "limit, its stiffness falls with each refinement"
        )
    if matrix.radius is not None:
        if mesh is None:
            raise TensegrityError("mesh is missing beside `radius` of the matrix: give both")
        if not matrix.density:
            raise TensegrityError("density 0 kg/m^3 of a matrix with a mesh must be above 0")
        body = meshed(matrix, lattice.positions, lattice.vectors, mesh)
    whole = Embedded(lattice, matrix, body, np.zeros((lattice.dim, lattice.dim)))
    return whole.released() if cast == "released" else whole
