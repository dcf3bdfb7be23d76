"""The cell of a lattice: nodes, members within and between cells, compatibility and stress.

A cell has nodes x_i; d lattice vectors a_1 .. a_d lead from cell to cell, one in strips and
columns, two in plates, three in solids.  A member joins node i of a cell to node j of the cell at
offset o, with o.a between the two.  The energy of a cell is a function of (x, a); a rate of (x, a)
is an array of rows, the nodes' first, then the vectors'.
Source: Guest & Hutchinson 2003, On the determinacy of repetitive structures, for the counts of
self-stress and mechanisms; Born & Huang, Dynamical Theory of Crystal Lattices, for the stress.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.forces import of_both_ends
from tensegrity.engine.inertia import ACROSS, END
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.periodic import (
    Assembly,
    Entries,
    Medium,
    UnderGradients,
    members_under_gradients,
)
from tensegrity.readonly import fixed
from tensegrity.springs.kinks import TAUT
from tensegrity.structures import statics
from tensegrity.structures.framework import Framework
from tensegrity.structures.members import Members
from tensegrity.structures.shape import prestress
from tensegrity.structures.statics import SelfStress
from tensegrity.structures.supports import orthonormal
from tensegrity.typing import Array, Indices

DEPENDENT = 1e-10  # least singular value of the lattice vectors over the largest


def independent_vectors(given: Any, dim: int) -> Array:
    """Lattice vectors (d, dim) [m], checked.

    Parameters
    ----------
    given : array_like
    dim : int

    Returns
    -------
    ndarray, (d, dim)

    Raises
    ------
    TensegrityError
    """
    vectors = check.floats("vectors", given)
    if vectors.ndim != 2 or vectors.shape[1] != dim or not 1 <= len(vectors) <= dim:
        raise TensegrityError(
            f"vectors have shape {vectors.shape}, must be (d, {dim}) with d from 1 to {dim}"
        )
    check.finite("vectors", vectors)
    sizes = np.linalg.svd(vectors, compute_uv=False)
    if not sizes[-1] > DEPENDENT * sizes[0]:
        raise TensegrityError(
            f"vectors are dependent: their least singular value {sizes[-1]:.3g} m must be above "
            f"{DEPENDENT:g} of the largest {sizes[0]:.3g} m"
        )
    return vectors


def ends_and_offsets(name: str, given: Any, nodes: int, d: int) -> tuple[Indices, Indices]:
    """The nodes and offsets of the bars or strings, checked.

    Parameters
    ----------
    name : str
        "bar" or "string", for messages.
    given : sequence of (int, int, offset)
    nodes, d : int
        Numbers of nodes and of lattice vectors.

    Returns
    -------
    tuple of two ndarrays of int, (members, 2) and (members, d)

    Raises
    ------
    TensegrityError
    """
    try:
        listed = [tuple(entry) for entry in given]
    except TypeError:
        raise TensegrityError(
            f"{name}s {check.shown(given)} must be (node, node, offset) each"
        ) from None
    pairs, offsets = [], []
    for entry in listed:
        if len(entry) not in (2, 3):
            raise TensegrityError(f"{name} {check.shown(entry)} must be (node, node, offset)")
        offset = entry[2] if len(entry) == 3 else (0,) * d
        if d == 1 and np.ndim(offset) == 0:
            offset = (offset,)
        words = check.sequence(f"offset of a {name}", offset, f"{d} integers")
        if len(words) != d:
            raise TensegrityError(
                f"offset {check.shown(offset)} of a {name} must be {d} integers, one per vector"
            )
        numbers = [check.whole(f"offset of a {name}", n, least=-(2**31)) for n in words]
        ends = [check.whole(f"node of a {name}", n, least=0, below=nodes) for n in entry[:2]]
        if ends[0] == ends[1] and not any(numbers):
            raise TensegrityError(f"{name} joins node {ends[0]} to itself: its length is 0 m")
        pairs.append(ends)
        offsets.append(numbers)
    return (
        np.array(pairs, dtype=np.int64).reshape(-1, 2),
        np.array(offsets, dtype=np.int64).reshape(-1, d),
    )


def refuse_reversed(ends: Indices, offsets: Indices, bars: int) -> None:
    """Refuse a member that is given again from its other end, which is a slip in most lattices.

    Parameters
    ----------
    ends, offsets : ndarray of int, (members, 2) and (members, d)
    bars : int
        Number of bars, which come first.

    Raises
    ------
    TensegrityError
    """
    first: dict[tuple[int, ...], int] = {}
    for number, ((i, j), offset) in enumerate(zip(ends.tolist(), offsets.tolist(), strict=True)):
        other = first.get((j, i, *(-n for n in offset)))
        if other is not None:
            words = [f"{'bar' if m < bars else 'string'} {m}" for m in (other, number)]
            raise TensegrityError(
                f"{words[0]} and {words[1]} both join nodes {i} and {j} at offset {tuple(offset)}, "
                "one from its other end: give parallel members with the same ends and offset"
            )
        first.setdefault((i, j, *offset), number)


AT_REST = 1e-6  # residual force on a node in equilibrium, over the tensions
LARGEST = 1e60  # of stiffnesses, masses and lengths in SI units
MOVED = 1e-9  # the same over the largest stiffness times the least length


class Cell(Framework, Medium):
    """Nodes joined by bars and strings, in a cell that repeats; see `Lattice`."""

    _may_coincide = True

    @checked
    def __init__(
        self,
        positions: ArrayLike,
        vectors: ArrayLike,
        bars: Sequence[Any] = (),
        strings: Sequence[Any] = (),
        k_bar: ArrayLike | None = None,
        k_string: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        natural_lengths: ArrayLike | None = None,
        buckling: ArrayLike | None = None,
        plateau: Annotated[float, ">= 0", "< 1"] = 0.0,
        *,
        EA_bar: ArrayLike | None = None,
        EA_string: ArrayLike | None = None,
        bar_mass: ArrayLike | None = None,
        string_mass: ArrayLike | None = None,
    ) -> None:
        self._set_positions(positions)
        self.vectors = independent_vectors(vectors, self.dim)
        listed = [
            ends_and_offsets(name, entries, self.nodes, len(self.vectors))
            for name, entries in (("bar", bars), ("string", strings))
        ]
        self.offsets = np.concatenate([offsets for _, offsets in listed])
        pairs = [ends for ends, _ in listed]
        refuse_reversed(np.concatenate(pairs), self.offsets, len(pairs[0]))
        stiff = {"bar": (k_bar, EA_bar), "string": (k_string, EA_string)}
        given = stiff, (mass, bar_mass, string_mass), natural_lengths, self.span
        self._set_members(pairs, *given, buckling=buckling, plateau=plateau)
        self._refuse_massless(range(self.nodes))

    @property
    def span(self) -> float:
        """Size of a cell: the longest lattice vector [m]."""
        return float(np.sqrt(np.sum(self.vectors**2, axis=1)).max())

    @property
    def size(self) -> float:
        """Length, area or volume of a cell [m^d]."""
        return float(np.sqrt(np.linalg.det(self.vectors @ self.vectors.T)))

    @cached_property
    def shift(self) -> Array:  # type: ignore[override]
        """From the second end of each member to its image [m], (members, dim)."""
        return fixed(self.offsets @ self.vectors)

    @cached_property
    def incidence(self) -> Array:
        """Separations of the members per (x, a), (members, nodes + d)."""
        inside, each = np.zeros((len(self.ends), self.nodes)), np.arange(len(self.ends))
        inside[each, self.ends[:, 0]] -= 1
        inside[each, self.ends[:, 1]] += 1
        return fixed(np.hstack([inside, self.offsets]))

    @property
    def stress(self) -> Array:
        """Macroscopic stress at the positions [N/m^(d - 1)], (dim, dim); tension > 0.

        Force over the size of the cell: a force in strips and columns, force per width in plates.
        """
        d = self.members.separations(self.positions)[0]
        return np.asarray((self.densities[:, None] * d).T @ self.shift / self.size)

    def at(self, positions: ArrayLike, vectors: ArrayLike | None = None, **other: Any) -> Self:
        """A copy of the lattice at other positions, with other arguments replaced by name; where
        natural lengths change, EA stays as it is if it was given, and else the spring constant."""
        members = [(i, j, tuple(o)) for (i, j), o in zip(self.ends, self.offsets, strict=True)]
        own: dict[str, Any] = {
            "bars": members[: self.bars],
            "strings": members[self.bars :],
            **self._masses(),
            "natural_lengths": self.natural_lengths,
            "buckling": self.buckling,
            "plateau": self.plateau,
        }
        vectors = self.vectors if vectors is None else vectors
        return type(self)(positions, vectors, **(own | self._stiff_unless(other) | other))

    def prestressed(
        self,
        force_densities: ArrayLike | None = None,
        prestrain: Mapping[int, float] | None = None,
        *,
        tension: Mapping[int, float] | None = None,
    ) -> Self:
        """The same shape under prestress, which may not buckle a bar.

        Parameters
        ----------
        force_densities, prestrain, tension : optional
            One of them, as of `Structure.prestressed`.

        Returns
        -------
        Lattice

        Raises
        ------
        TensegrityError, EquilibriumError
            As `Structure.prestressed`, or if a bar would buckle.
        """
        return prestress(
            self, lambda: self._equilibrium_matrix(False), self.self_stress,
            force_densities, prestrain, tension,
        )  # fmt: skip

    # the shape alone

    def _equilibrium_matrix(self, strain: bool) -> Array:
        rows = self.nodes + (len(self.vectors) if check.truth("strain", strain) else 0)
        d = self.members.separations(self.positions)[0]
        whole: Array = np.einsum("mr,mi->rim", self.incidence[:, :rows], d)
        return whole.reshape(-1, len(d))

    def rigid_motions(self, strain: bool = False) -> Array:
        """Orthonormal translations and rotations that leave the lattice periodic.

        Parameters
        ----------
        strain : bool, optional
            Whether the lattice vectors move too.  If not, only the rotation of a column about its
            axis is periodic.

        Returns
        -------
        ndarray, (rows dim, count)
        """
        nodes, dim = self.positions.shape
        moved = np.vstack([np.ones((nodes, 1)), np.zeros((len(self.vectors), 1))])
        shifts = np.kron(moved, np.eye(dim))
        centre = self.positions.mean(axis=0)
        arms = np.vstack([self.positions - centre, self.vectors]) / self.span
        turns = []
        for i in range(dim):
            for j in range(i + 1, dim):
                turn = np.zeros_like(arms)
                turn[:, i], turn[:, j] = -arms[:, j], arms[:, i]
                turns.append(turn.ravel())
        rotations = np.column_stack(turns)
        if check.truth("strain", strain):
            return orthonormal(np.hstack([shifts, rotations]))
        _, sizes, right = np.linalg.svd(rotations[nodes * dim :])
        periodic = right[int(np.sum(sizes > DEPENDENT)) :].T
        return orthonormal(np.hstack([shifts, rotations @ periodic])[: nodes * dim])

    def self_stress(self, strain: bool = False) -> SelfStress:
        """States of self-stress of the shape.

        Parameters
        ----------
        strain : bool, optional
            False: in equilibrium at the nodes, with any macroscopic stress; True: those without
            macroscopic stress, which a free-standing lattice can have.

        Returns
        -------
        SelfStress
        """
        carry = self.lengths > 0  # a spring without length has its stiffness as force density
        tied = None if carry.all() else np.eye(len(carry))[:, carry]
        return statics.null_states(self._equilibrium_matrix(strain), self, strain, tied)

    def _rates(self, motions: Array) -> Array:
        """Differences of motions of the ends of members, as in `Framework`, of vectors too."""
        return np.einsum("mr,crk->cmk", self.incidence[:, : motions.shape[1]], motions)

    def mechanisms(self, strain: bool = False) -> Array:
        """Inextensional mechanisms: orthonormal motions that change no length, without rigid ones.

        Parameters
        ----------
        strain : bool, optional
            Whether the lattice vectors move too; their rows follow those of the nodes.

        Returns
        -------
        ndarray, (count, nodes, dim) or (count, nodes + d, dim)
        """
        rigid = self.rigid_motions(strain)
        longest = self.lengths.max()
        motions = statics.free_motions(self._equilibrium_matrix(strain), rigid, longest)
        return motions.reshape(len(motions), len(rigid) // self.dim, self.dim)

    # the state

    @property
    def _rows(self) -> Array:
        """Positions of the nodes, then the lattice vectors [m], (nodes + d, dim)."""
        return np.vstack([self.positions, self.vectors])

    def _members_at(self, x: Array) -> Members:
        """The members where x holds positions only, or positions and lattice vectors."""
        if len(x) == self.nodes:
            return self.members
        return replace(self.members, shift=self.offsets @ x[self.nodes :])

    def _tangent(self, x: Array, within: float) -> Any:
        """Second derivatives of the energy of a cell in x [N/m], sparse; strings shorter than
        their natural length by at most `within` of it count as taut."""
        from scipy.sparse import bsr_array, csr_array, eye_array, kron

        blocks, each = self._members_at(x).blocks(x, within), np.arange(len(self.ends) + 1)
        stretch = kron(csr_array(self.incidence[:, : len(x)]), eye_array(x.shape[1]))
        size = blocks.shape[0] * blocks.shape[1]
        each_own = bsr_array((blocks, each[:-1], each), shape=(size, size))
        return (stretch.T @ each_own @ stretch).tocsr()

    @property
    def _unknowns(self) -> tuple[int, int]:
        """Nodes of a cell, and coordinates of a node."""
        return self.nodes, self.dim

    @property
    def blocks(self) -> Array:
        """Tangent stiffness of each member [N/m], (members, dim, dim)."""
        return self.members.blocks(self.positions)

    def _assembly(self, blocks: Array | None = None) -> Assembly:
        """Stiffness, masses of the coordinates, and the inertia of members that have mass; with
        other blocks of tangent stiffness (members, components, components)."""
        blocks = self.blocks if blocks is None else blocks
        mass, heavy = np.repeat(self.mass, blocks.shape[1]), []
        if self.has_heavy_members:
            each = np.kron([[END, ACROSS], [ACROSS, END]], np.eye(blocks.shape[1]))
            of_members = self.member_mass[:, None, None] * each
            heavy = [Entries.of_bonds(self.ends, self.offsets, of_members)]
        return [Entries.of_bonds(self.ends, self.offsets, of_both_ends(blocks))], mass, heavy

    def _under_gradients(self) -> UnderGradients:
        """What macroscopic gradients do to a cell."""
        return members_under_gradients(self, self.blocks)

    def _at_rest(self) -> tuple[Array, Array]:
        """Stiffness [N/m] and inertia [kg] of motions that are the same in all cells."""
        size = self.positions.size
        heavy = self.has_heavy_members
        mass = self.mass_matrix().toarray() if heavy else np.repeat(self.mass, self.dim)
        return self.hessian()[:size, :size], np.asarray(mass)

    def _coordinates(self) -> tuple[Indices, Indices]:
        """The node of each coordinate of a cell and its axis, (size,)."""
        nodes, axes = np.indices(self.positions.shape)
        return nodes.ravel(), axes.ravel()

    def hessian(self) -> Array:
        """Second derivatives of the energy of a cell in (x, a) [N/m], a square array of
        (nodes + d) dim rows."""
        check.memory(f"stiffness of {self.nodes} nodes", 16.0 * self._rows.size**2)
        return np.asarray(self._tangent(self._rows, TAUT).toarray())

    def refuse_unbalanced(self) -> None:
        """Refuse positions at which the nodes are not in equilibrium.

        Raises
        ------
        TensegrityError
            A stiffness, mass or length is too large or small to compute with.
        EquilibriumError
        """
        for name, unit in (("stiffnesses", "N/m"), ("mass", "kg"), ("member_mass", "kg"),
                           ("lengths", "m"), ("natural_lengths", "m")):  # fmt: skip
            values = getattr(self, name)
            wrong = values[~((values > 1 / LARGEST) & (values < LARGEST)) & (values != 0)]
            if wrong.size:
                words = f"must be above {1 / LARGEST:g} and below {LARGEST:g}"
                raise TensegrityError(f"{name} {wrong[0]:g} {unit} of a lattice {words}")
        left = float(np.abs(self.members.gradient(self.positions)).max())
        stiffest = float(
            self.stiffnesses.max() * self.lengths[self.lengths > 0].min(initial=np.inf)
        )
        allowed = AT_REST * float(np.abs(self.tensions).max()) + MOVED * stiffest
        if left > allowed:
            raise EquilibriumError(
                f"the unbalanced force {left:.6g} N on a node must be at most {allowed:.6g} N: the "
                "lattice is not in equilibrium; see Lattice.equilibrium"
            )

    def __repr__(self) -> str:
        d = len(self.vectors)
        return (
            f"{type(self).__name__}({self.nodes} node{'s' * (self.nodes > 1)}, "
            f"{d} vector{'s' * (d > 1)} in "
            f"{self.dim} dimensions, {self.bars} bars, {self.strings} strings)"
        )
