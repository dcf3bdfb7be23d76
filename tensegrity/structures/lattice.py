"""Lattices: bars and strings in a cell that repeats, with macroscopic strain and stress.

A cell has nodes x_i; d lattice vectors a_1 .. a_d lead from cell to cell, one in strips and
columns, two in plates, three in solids.  A member joins node i of a cell to node j of the cell at
offset o, with o.a between the two.  The energy of a cell is a function of (x, a); a rate of (x, a)
is an array of rows, the nodes' first, then the vectors'.
Source: Guest & Hutchinson 2003, On the determinacy of repetitive structures, for the counts of
self-stress and mechanisms; Born & Huang, Dynamical Theory of Crystal Lattices, for the stress.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.minimum import ROUND_OFF, STEPS, downhill, settle
from tensegrity.readonly import fixed
from tensegrity.springs.kinks import TAUT
from tensegrity.structures import statics
from tensegrity.structures.framework import Framework
from tensegrity.structures.lattice_input import (
    DEPENDENT,
    ends_and_offsets,
    independent_vectors,
    refuse_repeated,
)
from tensegrity.structures.members import FARTHEST, SETTLED, STEP, Members
from tensegrity.structures.structure import Structure
from tensegrity.structures.supports import orthonormal
from tensegrity.typing import Array, Indices

if TYPE_CHECKING:
    from tensegrity.structures.statics import SelfStress

AT_REST = 1e-6  # force left on a node of an equilibrium, over the tensions
MOVED = 1e-9  # the same over the largest stiffness times the least length
STRESSED = 1e-12  # tension over stiffness times length of a member under stress


class Lattice(Framework):
    """Nodes joined by bars and strings, in a cell that repeats.

    Parameters
    ----------
    positions : array_like, (nodes, dim)
        Positions of the nodes of one cell [m]; dim is 2 or 3.
    vectors : array_like, (d, dim)
        Lattice vectors [m], independent; d is 1 (strip, column), 2 (plate) or 3 (solid).
    bars, strings : sequence of (int, int, offset)
        The nodes that each member joins, and the offset of the second one's cell: d integers, for
        d = 1 an integer too; (i, j) lies in one cell.  Members of which only the sense or the cell
        differs are the same, and are given once.  Arrays hold bars first, then strings.
    k_bar, k_string : float or array_like, (bars,) or (strings,)
        Spring constants [N/m], > 0.
    mass : float or array_like, (nodes,), optional
        [kg], > 0.
    natural_lengths : array_like, (members,), optional
        Unstressed lengths [m]; by default the lengths at the positions.

    Attributes
    ----------
    positions, vectors, stiffnesses, natural_lengths, mass : ndarray
    ends, offsets : ndarray of int, (members, 2) and (members, d)
    is_string : ndarray of bool, (members,)

    Raises
    ------
    TensegrityError
        If the vectors are dependent, an offset is not d integers, a member has no length or is
        given twice, a node is in no member, or a number is outside its bounds.

    Examples
    --------
    A strip of Snelson's X modules, which share their verticals:

    >>> from tensegrity import Lattice
    >>> strip = Lattice([(0, 0), (0, 1)], [(1, 0)], bars=[(0, 1, 1), (1, 0, 1)],
    ...                 strings=[(0, 0, 1), (1, 1, 1), (0, 1)], k_bar=10, k_string=[1, 1, 2])
    >>> strip = strip.prestressed([-0.1, -0.1, 0.1, 0.1, 0.2])
    >>> print(strip, strip.tensions.round(3).tolist())
    Lattice(2 nodes, 1 vector in 2 dimensions, 2 bars, 3 strings) [-0.141, -0.141, 0.1, 0.1, 0.2]
    """

    def __init__(
        self,
        positions: ArrayLike,
        vectors: ArrayLike,
        bars: Sequence[Any] = (),
        strings: Sequence[Any] = (),
        k_bar: ArrayLike = 100.0,
        k_string: ArrayLike = 1.0,
        mass: ArrayLike = 1.0,
        natural_lengths: ArrayLike | None = None,
    ) -> None:
        self._set_positions(positions)
        self.vectors = independent_vectors(vectors, self.dim)
        given = [
            ends_and_offsets(name, entries, self.nodes, len(self.vectors))
            for name, entries in (("bar", bars), ("string", strings))
        ]
        self.offsets = np.concatenate([offsets for _, offsets in given])
        pairs = [ends for ends, _ in given]
        refuse_repeated(np.concatenate(pairs), self.offsets, len(pairs[0]))
        self._set_members(pairs, k_bar, k_string, mass, natural_lengths, self.span)

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
        found, each = np.zeros((len(self.ends), self.nodes)), np.arange(len(self.ends))
        found[each, self.ends[:, 0]] -= 1
        found[each, self.ends[:, 1]] += 1
        return fixed(np.hstack([found, self.offsets]))

    @property
    def stress(self) -> Array:
        """Macroscopic stress at the positions [N/m^(d - 1)], (dim, dim); tension > 0.

        Force over the size of the cell: a force in strips and columns, force per width in plates.
        """
        d = self.members.separations(self.positions)[0]
        return np.asarray((self.densities[:, None] * d).T @ self.shift / self.size)

    def at(self, positions: ArrayLike, vectors: ArrayLike | None = None, **other: Any) -> Lattice:
        """A copy of the lattice at other positions, with other arguments replaced by name."""
        members = [(i, j, tuple(o)) for (i, j), o in zip(self.ends, self.offsets, strict=True)]
        own: dict[str, Any] = {
            "bars": members[: self.bars],
            "strings": members[self.bars :],
            "k_bar": self.stiffnesses[: self.bars],
            "k_string": self.stiffnesses[self.bars :],
            "mass": self.mass,
            "natural_lengths": self.natural_lengths,
        }
        return Lattice(positions, self.vectors if vectors is None else vectors, **(own | other))

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
        return statics.null_states(self._equilibrium_matrix(strain), self.is_string)

    def mechanisms(self, strain: bool = False) -> Array:
        """Inextensional mechanisms: orthonormal motions that change no length, rigid ones out.

        Parameters
        ----------
        strain : bool, optional
            Whether the lattice vectors move too; their rows follow those of the nodes.

        Returns
        -------
        ndarray, (count, nodes, dim) or (count, nodes + d, dim)
        """
        rigid = self.rigid_motions(strain)
        found = statics.free_motions(self._equilibrium_matrix(strain), rigid)
        return found.reshape(len(found), len(rigid) // self.dim, self.dim)

    # the state

    def hessian(self) -> Array:
        """Second derivatives of the energy of a cell in (x, a) [N/m], a square array of
        (nodes + d) dim rows."""
        return np.asarray(_Strained(self, True).tangent(self._rows(), TAUT).toarray())

    def _rows(self) -> Array:
        return np.vstack([self.positions, self.vectors])

    def refuse_unbalanced(self) -> None:
        """Refuse positions at which the nodes are not in equilibrium.

        Raises
        ------
        EquilibriumError
        """
        left = float(np.abs(self.members.gradient(self.positions)).max())
        stiffest = float(self.stiffnesses.max() * self.lengths.min())
        allowed = AT_REST * float(np.abs(self.tensions).max()) + MOVED * stiffest
        if left > allowed:
            raise EquilibriumError(
                f"the unbalanced force {left:.6g} N on a node must be at most {allowed:.6g} N: the "
                "lattice is not in equilibrium; see Lattice.equilibrium"
            )

    def equilibrium(self, gradient: ArrayLike | None = None) -> Lattice:
        """The lattice in equilibrium under a macroscopic strain, by minimising the energy.

        Parameters
        ----------
        gradient : array_like, (dim, dim), optional
            Deformation gradient F: the lattice vectors a become F a, and the nodes move from F x
            into equilibrium.  By default the vectors are free, and the stress becomes 0.

        Returns
        -------
        Lattice

        Raises
        ------
        EquilibriumError
            If there is no equilibrium nearby, or with free vectors no member is under stress.
        """
        free = gradient is None
        f = np.eye(self.dim)
        if gradient is not None:
            f = check.vector("gradient", gradient, (self.dim, self.dim))
            if not np.linalg.det(f) > 0:
                raise TensegrityError(f"determinant {np.linalg.det(f):g} of gradient must be > 0")
        start = self.at(self.positions @ f.T, self.vectors @ f.T)
        of, rows = _Strained(start, free), start._rows()
        x, left = settle(of, rows if free else rows[: self.nodes])
        unbalanced, size = float(np.abs(left).max()), of.largest(x)
        if not unbalanced <= max(SETTLED * size, ROUND_OFF * self.stiffnesses.max() * self.span):
            words = f"{unbalanced:.3g} N of {size:.3g} N are unbalanced after {STEPS} iterations"
            raise EquilibriumError(f"no equilibrium found: {words}")
        found = start.at(x[: self.nodes], x[self.nodes :] if free else None)
        carry = np.abs(found.tensions) > STRESSED * self.stiffnesses * self.natural_lengths
        if free and not carry.any() and found.strings:
            raise EquilibriumError(
                "these natural lengths leave all members without stress, at free lattice vectors: "
                "no prestress holds a shape"
            )
        return found

    # more cells

    def _copies(self, counts: Any) -> tuple[tuple[int, ...], Indices, Indices, Indices]:
        """Cells either way; cells (cells, d); and for each member, then each cell: the cells of
        its second ends, (members, cells, d)."""
        d = len(self.vectors)
        one = d == 1 and not hasattr(counts, "__len__")
        many = (counts,) if one else check.sequence("counts", counts, "whole numbers")
        if len(many) != d:
            raise TensegrityError(f"counts {check.shown(counts)} must be {d} whole numbers")
        shape = tuple(check.whole("count", n, least=1) for n in many)
        check.room(f"{check.shown(shape)} cells", 1e3 * len(self.ends) * float(math.prod(shape)))
        cells = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1)
        return shape, cells, cells[None] + self.offsets[:, None], np.array(shape)

    def _numbered(self, shape: tuple[int, ...], member: int, cells: Any) -> Indices:
        """Pairs of nodes of the copies of a member."""
        i, j = self.ends[member]
        first = np.arange(np.prod(shape)) * self.nodes + i
        second = np.ravel_multi_index(tuple(cells.T), shape) * self.nodes + j
        return np.stack([first, second], axis=1)

    def repeated(self, counts: Any) -> Lattice:
        """The same lattice with a larger cell.

        Parameters
        ----------
        counts : sequence of int, (d,), or int where d = 1
            Number of cells along each vector.

        Returns
        -------
        Lattice
            Nodes cell by cell; members one by one, the copies of each cell by cell.
        """
        shape, cells, ends, many = self._copies(counts)
        copies = [
            [(i, j, tuple(o)) for (i, j), o in zip(
                self._numbered(shape, m, ends[m] % many), ends[m] // many, strict=True)]
            for m in range(len(ends))
        ]  # fmt: skip
        return Lattice(
            (self.positions + (cells @ self.vectors)[:, None]).reshape(-1, self.dim),
            self.vectors * many[:, None],
            **self._copied(copies),
            mass=np.tile(self.mass, len(cells)),
        )

    def tile(self, counts: Any) -> Structure:
        """Some cells cut out, with the members of which both ends are inside.

        Parameters
        ----------
        counts : sequence of int, (d,), or int where d = 1
            Number of cells along each vector.

        Returns
        -------
        Structure
            Nodes and members in the order of `repeated`.  At the border it is not in equilibrium:
            see `Structure.relaxed`.
        """
        shape, cells, ends, many = self._copies(counts)
        copies = []
        for m, second in enumerate(ends):
            inside = np.all((second >= 0) & (second < many), axis=1)
            copies.append([tuple(p) for p in self._numbered(shape, m, second % many)[inside]])
        return Structure(
            (self.positions + (cells @ self.vectors)[:, None]).reshape(-1, self.dim),
            **self._copied(copies),
            mass=np.tile(self.mass, len(cells)),
        )

    def _copied(self, copies: list[list[Any]]) -> dict[str, Any]:
        """Arguments of members for the copies of each member."""
        numbers = [len(each) for each in copies]
        k, flat = np.repeat(self.stiffnesses, numbers), [p for each in copies for p in each]
        bars = sum(numbers[: self.bars])
        return {
            "bars": flat[:bars],
            "strings": flat[bars:],
            "k_bar": k[:bars],
            "k_string": k[bars:],
            "natural_lengths": np.repeat(self.natural_lengths, numbers),
        }

    def __repr__(self) -> str:
        d = len(self.vectors)
        return (
            f"Lattice({self.nodes} node{'s' * (self.nodes > 1)}, {d} vector{'s' * (d > 1)} in "
            f"{self.dim} dimensions, {self.bars} bars, {self.strings} strings)"
        )


@dataclass(frozen=True)
class _Strained:
    """The energy of a cell over its nodes, and over its vectors too if they are free: a
    `minimum.Energy` of rows x."""

    lattice: Lattice
    free: bool

    @property
    def longest(self) -> float:
        return STEP * self.lattice.span

    def members(self, x: Array) -> Members:
        of = self.lattice
        return replace(of.members, shift=of.offsets @ x[of.nodes :]) if self.free else of.members

    def energy(self, x: Array) -> tuple[float, float]:
        stored = self.members(x).energy(x)
        return stored, stored

    def forces(self, x: Array) -> Array:
        members, rigid = self.members(x), self.rigid(x)
        d, lengths = members.separations(x)
        pull = (members.stiffness * members.elongations(lengths) / lengths)[:, None] * d
        left = -(self.lattice.incidence[:, : len(x)].T @ pull).ravel()
        return np.asarray(left - rigid @ (rigid.T @ left)).reshape(x.shape)

    def rigid(self, x: Array) -> Array:
        if not self.free:
            return self.lattice.rigid_motions()
        nodes = self.lattice.nodes
        return self.lattice.at(x[:nodes], x[nodes:]).rigid_motions(strain=True)

    def largest(self, x: Array) -> float:
        return float(np.abs(self.members(x).tensions(x)).max())

    def tangent(self, x: Array, within: float) -> Any:
        from scipy.sparse import bsr_array, csr_array, eye_array, kron

        blocks, each = self.members(x).blocks(x, within), np.arange(len(self.lattice.ends) + 1)
        stretch = kron(csr_array(self.lattice.incidence[:, : len(x)]), eye_array(x.shape[1]))
        size = blocks.shape[0] * blocks.shape[1]
        each_own = bsr_array((blocks, each[:-1], each), shape=(size, size))
        return (stretch.T @ each_own @ stretch).tocsr()

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        from scipy.sparse import eye_array

        start = np.array_equal(x[: self.lattice.nodes], self.lattice.positions)
        tangent, rigid = self.tangent(x, TAUT if start else 0.0), self.rigid(x)
        softest = float(self.lattice.stiffnesses.min()) * eye_array(f.size)

        def step(shift: float) -> Array | None:
            move = downhill(tangent + shift * softest, rigid, f.ravel())
            return None if move is None else move.reshape(x.shape)

        return step

    def refuse(self, x: Array, f: Array) -> None:
        span = self.lattice.span
        if np.ptp(x, axis=0).max() > FARTHEST * span:
            raise EquilibriumError(f"no equilibrium: the cell grows beyond {FARTHEST * span:g} m")
