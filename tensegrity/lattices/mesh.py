"""The matrix of a cell in finite elements: rings about rigid patches, or a mesh from a file.

Each bonded node is a rigid disc or ball.  The part of space that is nearer to it than to any other
bonded node, a Voronoi cell, is meshed along rays from the patch to the faces, which neighbours
share: such a mesh is conforming and periodic by construction.  Layers are in geometric proportion
along a ray.  Vertices are identified modulo the lattice, whatever mesh they belong to; a vertex in
a patch moves by T of the node's displacement and rotation.
Source: G. Voronoi 1908, for the cells; scikit-fem assembles the elements (Gustafsson & McBain 2020,
scikit-fem: A Python package for finite element assembly).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product
from os import PathLike
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.lattices.matrix import Matrix, images
from tensegrity.lattices.periodic import Entries
from tensegrity.typing import Array, Flags, Indices

ALIKE = 1e-7  # distance of vertices that are the same, over the size of the cell
NEAR = 1e-6  # of a radius: vertices that belong to the patch


@dataclass(frozen=True, eq=False)
class Body:
    """The matrix of a cell as finite elements, by the displacements of their vertices, and these by
    the coordinates of a cell.

    Attributes
    ----------
    matrix : Matrix
    positions, vectors : ndarray, (nodes, dim) and (d, dim)
        Of the nodes of the lattice [m].
    radii : dict
        {bonded node: radius [m]}
    mesh : skfem.Mesh
        Of linear elements.
    patch : ndarray of int, (vertices,)
        The node in whose patch a vertex lies, or -1.
    same : ndarray of int, (vertices,)
        The vertex that represents it, among those of one position modulo the lattice.
    offset : ndarray of int, (vertices, d)
        Offset of its cell from that of the node or of the vertex which it moves with.
    moved : ndarray, (vertices components,), or None
        Displacements of the vertices since the casting, which stress the matrix [m].
    """

    matrix: Matrix
    positions: Array
    vectors: Array
    radii: dict[int, float]
    mesh: Any
    patch: Indices
    same: Indices
    offset: Indices
    moved: Array | None = None

    @cached_property
    def elements(self) -> Any:
        """The basis of scikit-fem, of the elements outside the patches."""
        import skfem
        from skfem import quadrature, refdom

        of, patch = self.mesh, self.patch[self.mesh.t]
        within = (patch >= 0) & (patch == patch[0])  # of one patch, and of one cell
        within &= (self.offset[of.t] == self.offset[of.t[0]]).all(axis=2)
        one, rule = of.elem(), None
        if of.refdom is refdom.RefWedge:  # the product of two rules
            both = (quadrature.get_quadrature(one, 2) for one in (refdom.RefLine, refdom.RefTri))
            (x, v), (y, w) = both
            points = np.vstack([np.repeat(y, len(v), axis=1), np.tile(x, len(w))])
            rule = points, np.repeat(w, len(v)) * np.tile(v, len(w))
        one = one if self.matrix.antiplane else skfem.ElementVector(one)
        return skfem.Basis(of, one, elements=np.flatnonzero(~within.all(axis=0)), quadrature=rule)

    @property
    def components(self) -> int:
        """Components of a displacement."""
        return 1 if self.matrix.antiplane else len(self.vectors)

    @cached_property
    def elastic(self) -> Any:
        """Elastic stiffness [N/m], sparse."""
        from skfem.models.elasticity import linear_elasticity
        from skfem.models.poisson import laplace

        if self.matrix.antiplane:
            return self.matrix.shear * laplace.assemble(self.elements)
        return linear_elasticity(self.matrix.lame, self.matrix.shear).assemble(self.elements)

    @cached_property
    def stiffness(self) -> Any:
        """Stiffness under stress [N/m], sparse."""
        if self.moved is None:
            return self.elastic
        import skfem
        from skfem.helpers import grad, sym_grad
        from skfem.models.elasticity import linear_stress

        stress = linear_stress(self.matrix.lame, self.matrix.shear)

        def form(u: Any, v: Any, w: Any) -> Any:
            pulled = stress(sym_grad(w["past"]))
            return np.einsum("ij...,jl...,il...", grad(u), pulled, grad(v))

        past = self.elements.interpolate(self.moved)
        return self.elastic + skfem.BilinearForm(form).assemble(self.elements, past=past)

    @cached_property
    def inertia(self) -> Any:
        """Mass matrix [kg], sparse."""
        import skfem
        from skfem.helpers import dot
        from skfem.models.poisson import mass

        of = mass if self.matrix.antiplane else skfem.BilinearForm(lambda u, v, _: dot(u, v))
        return self.matrix.density * of.assemble(self.elements)

    @cached_property
    def volume(self) -> float:
        """Of the matrix [m^d]."""
        return float(self.elements.dx.sum())

    @property
    def turns(self) -> int:
        """Number of rotations of a patch."""
        dim = len(self.vectors)
        return 0 if self.matrix.antiplane else dim * (dim - 1) // 2

    @cached_property
    def own(self) -> Flags:
        """The vertices with coordinates of their own, (vertices,)."""
        return (self.patch < 0) & (self.same == np.arange(len(self.same)))

    @cached_property
    def coordinates(self) -> tuple[Indices, Indices]:
        """The node of each coordinate of a cell, or -1, and its axis, or -1 of rotations, (size,):
        displacements of the nodes, rotations of the patches times their radii, displacements of
        the free vertices."""
        count, free = self.components, np.count_nonzero(self.own)
        turned, each = np.repeat([*self.radii], self.turns), np.arange(count)
        node = [np.repeat(np.arange(len(self.positions)), count), turned, np.full(free * count, -1)]
        axis = [np.tile(each, len(self.positions)), 0 * turned - 1, np.tile(each, free)]
        return np.concatenate(node), np.concatenate(axis)

    @cached_property
    def _motion(self) -> tuple[Any, Indices, Array]:
        """T, by the coordinates of all cells that a vertex may move with, side by side, sparse;
        the offsets of these; and the place where each vertex is held [m], (vertices, dim)."""
        from scipy.sparse import coo_array

        x, patch, count = self.mesh.p.T, self.patch, self.components
        size = len(self.coordinates[0])
        place = size - count * (self.own.sum() - np.cumsum(self.own) + 1)[self.same]
        offsets, cell = np.unique(self.offset, axis=0, return_inverse=True)
        bonded, held = patch >= 0, x.copy()
        held[bonded] = (self.positions[patch] + self.offset @ self.vectors)[bonded]
        start = np.where(bonded, count * patch, place) + size * cell.ravel()
        vertex, axis = np.arange(len(x))[:, None], np.arange(count)
        parts = [(count * vertex + axis, start[:, None] + axis, np.ones((len(x), count)))]
        pairs = [*combinations(range(len(self.vectors)), 2)][: self.turns]
        column = len(self.positions) * count - 1
        for node, radius in self.radii.items():
            mine = np.flatnonzero(patch == node)
            for i, j in pairs:
                column += 1
                arms, at = (x - held)[mine] / radius, column + size * cell.ravel()[mine]
                parts += [(count * mine + i, at, -arms[:, j]),
                          (count * mine + j, at, arms[:, i])]  # fmt: skip
        row, column, each = (np.concatenate([np.ravel(one[k]) for one in parts]) for k in range(3))
        shape = len(x) * count, size * len(offsets)
        return coo_array((each, (row, column)), shape=shape).tocsr(), offsets, held

    def entries(self, whole: Any) -> Entries:
        """Those of T^H K T, of a matrix K by the vertices."""
        motion, offsets, _ = self._motion
        own = (motion.T @ whole @ motion).tocoo()
        size = len(self.coordinates[0])
        first, second = own.row // size, own.col // size
        apart = (offsets[None] - offsets[:, None]).reshape(-1, offsets.shape[1])
        distinct, number = np.unique(apart, axis=0, return_inverse=True)
        number = number.ravel()[first * len(offsets) + second]
        return Entries(distinct, number, own.row % size, own.col % size, own.data)

    @cached_property
    def alike(self) -> Any:
        """T of motions that are alike in all cells, sparse, (vertices components, size)."""
        from scipy.sparse import csr_array

        motion = self._motion[0].tocoo()
        shape = motion.shape[0], len(self.coordinates[0])
        return csr_array((motion.data, (motion.row, motion.col % shape[1])), shape=shape)

    def displacements(self, q: Array, shapes: Any) -> Any:
        """Displacements of the vertices (vertices components, count) in waves of phases (d,), by
        those of the coordinates (size, count)."""
        turns = np.exp(1j * (self._motion[1] @ q))
        return self._motion[0] @ np.kron(turns[:, None], shapes)

    @cached_property
    def gradients(self) -> Array:
        """Displacements of the vertices under gradients h_kl of 1 [m], (vertices components,
        gradients): patches move as the node does."""
        held = self._motion[2]
        each = np.einsum("ik,vl->vikl", np.eye(self.components), held)
        return each.reshape(len(held) * self.components, -1)


def meshed(matrix: Matrix, positions: Array, vectors: Array, mesh: Any) -> Body:
    """The matrix of a cell in a periodic mesh.

    Parameters
    ----------
    matrix : Matrix
        With a radius.
    positions, vectors : ndarray, (nodes, dim) and (d, dim)
        [m]
    mesh : int, path or skfem.Mesh
        Number of elements between a patch and each face of its Voronoi cell, and along the edges of
        the face; or a mesh of linear elements of one cell, with the patches or without.

    Returns
    -------
    Body

    Raises
    ------
    TensegrityError
        Patches that overlap, a radius below an element, or a mesh that is not periodic.
    """
    skfem, d = check.package("skfem", "a matrix with a mesh", "matrix"), len(vectors)
    radii = matrix._radii(positions, vectors)
    if isinstance(mesh, (str, PathLike)):
        check.package("meshio", "a mesh from a file", "matrix")
        try:
            mesh = skfem.Mesh.load(check.path("mesh", mesh))
        except Exception as error:  # of one of its many formats
            raise TensegrityError(f"mesh {check.shown(mesh)} cannot be read: {error}") from error
    elif not isinstance(mesh, skfem.Mesh):
        points, cells = _rings(check.whole("mesh", mesh, least=1), radii, positions, vectors)
        kind = skfem.MeshQuad1 if d == 2 else skfem.MeshWedge1
        mesh = kind(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T))
    if len(mesh.p) != d or mesh.nelements == 0:
        raise TensegrityError(f"mesh has {len(mesh.p)} dimensions, must have {d}")
    mesh = mesh.remove_unused_nodes()
    x, patch = mesh.p.T, np.full(mesh.nvertices, -1)
    same, offset = _identified(x, vectors)
    for node, radius in radii.items():
        cells = np.rint((x - positions[node]) @ np.linalg.inv(vectors)).astype(np.int64)
        near = np.linalg.norm(x - positions[node] - cells @ vectors, axis=1)
        mine = near <= (1 + NEAR) * radius
        if np.count_nonzero(mine) <= d:
            raise TensegrityError(
                f"radius {radius:g} m of node {node} is below an element of the mesh: "
                f"{np.count_nonzero(mine)} vertices lie in its patch, must be at least {d + 1}"
            )
        patch[mine], offset[mine] = node, cells[mine]
    return _refuse_open(Body(matrix, positions, vectors, radii, mesh, patch, same, offset))


def _refuse_open(body: Body) -> Body:
    """The body, refused where a facet of its boundary has no partner modulo the lattice."""
    of, counts = body.mesh, Counter[tuple[tuple[int, ...], ...]]()
    for facet in of.facets[:, of.f2t[1] < 0].T:
        at = [(int(body.same[v]), *body.offset[v].tolist()) for v in {*facet.tolist()}]
        if (body.patch[facet] < 0).any():
            _, *first = min(at)
            shifted = [(v, *np.subtract(o, first).tolist()) for v, *o in at]
            counts[tuple(sorted(shifted))] += 1
    alone = sum(count != 2 for count in counts.values())
    if alone:
        raise TensegrityError(
            f"mesh is not periodic: {alone} facets of its boundary must have one partner each, "
            "shifted by a lattice vector, or lie on a patch"
        )
    return body


def _identified(points: Array, vectors: Array) -> tuple[Indices, Indices]:
    """The first of the points that are the same modulo the lattice, (points,), and the offset of
    each from it, (points, d)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    turns = points @ np.linalg.inv(vectors)
    inside = turns - np.floor(turns)
    tree = cKDTree(np.where(inside < 1, inside, 0.0), boxsize=1.0)
    pairs = tree.query_pairs(ALIKE, output_type="ndarray").T
    graph = coo_array((np.ones(pairs.shape[1]), pairs), shape=(len(points),) * 2)
    _, group = connected_components(graph, directed=False)
    same = np.unique(group, return_index=True)[1][group]
    return same, np.rint(turns - turns[same]).astype(np.int64)


def _rings(
    layers: int, radii: dict[int, float], positions: Array, vectors: Array
) -> tuple[Array, Indices]:
    """Vertices and elements, quadrilaterals or wedges, along rays from the patches to the faces of
    their Voronoi cells."""
    from scipy.spatial import Voronoi

    d = len(vectors)
    points: list[Array] = []
    cells: list[Indices] = []
    centres, _ = images(positions[[*radii]], vectors)
    voronoi, middle = Voronoi(centres), (len(centres) - len(radii)) // 2
    weights, pieces = _pieces(layers, d)
    for number, (node, radius) in enumerate(radii.items()):
        centre = positions[node]
        mine = (voronoi.ridge_points == middle + number).any(axis=1)
        for ridge in np.flatnonzero(mine):
            for corners in _simplices(voronoi.vertices[voronoi.ridge_vertices[ridge]] - centre):
                if np.linalg.svd(corners[1:] - corners[0], compute_uv=False).min() < ALIKE * radius:
                    continue  # corners that differ by round-off
                arms = weights @ corners
                far = np.linalg.norm(arms, axis=1)
                if far.max() > 2**layers * radius:
                    raise TensegrityError(
                        f"radius {radius:g} m of node {node} is below an element: with mesh "
                        f"{layers} it must be at least {far.max() / 2**layers:.6g} m"
                    )
                part = (far / radius) ** (np.arange(layers + 1)[:, None] / layers)
                first = sum(map(len, points)) + len(arms) * np.arange(layers)[:, None, None]
                points.append((centre + (arms / far[:, None] * radius) * part[..., None])
                              .reshape(-1, d))  # fmt: skip
                outer = pieces[:, ::-1] if d == 2 else pieces  # in the order of the element
                cells.append(np.concatenate([first + pieces, first + len(arms) + outer], axis=2)
                             .reshape(-1, 2 * d))  # fmt: skip
    return np.concatenate(points), np.concatenate(cells)


def _simplices(face: Array) -> Array:
    """The face of a Voronoi cell as a segment, or as triangles about its centre."""
    if face.shape[1] == 2:
        return face[None]
    centre = face.mean(axis=0)
    x, y, _ = np.linalg.svd(face - centre)[2] @ (face - centre).T
    face = face[np.argsort(np.arctan2(y, x))]
    return np.stack([np.broadcast_to(centre, face.shape), face, np.roll(face, -1, axis=0)], axis=1)


def _pieces(count: int, d: int) -> tuple[Array, Indices]:
    """Barycentric coordinates of the points that divide a segment or a triangle, (points, d), and
    the segments or triangles between them, (pieces, d)."""
    grid = [
        (*k, count - sum(k)) for k in product(range(count + 1), repeat=d - 1) if sum(k) <= count
    ]
    number = {k: n for n, k in enumerate(grid)}
    one = np.eye(d, dtype=int)
    shapes = [one] if d == 2 else [one, 1 - one]  # upright, and turned over
    pieces = [
        [number[tuple(k)] for k in np.add(low, shape).tolist()]
        for shape in shapes
        for low in product(range(count), repeat=d)
        if sum(low) + shape[0].sum() == count
    ]
    return np.array(grid) / count, np.array(pieces)
