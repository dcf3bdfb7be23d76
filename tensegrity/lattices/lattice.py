"""Lattices: states under macroscopic strain, larger cells, and finite parts of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.cell import Cell
from tensegrity.lattices.embedded import Embedded, embedded
from tensegrity.lattices.matrix import Matrix
from tensegrity.lattices.moduli import Stability, stability
from tensegrity.minimum import downhill, refuse_unbalanced, settle
from tensegrity.scenes.force import Force
from tensegrity.scenes.forcing import Damping, Drive
from tensegrity.scenes.network import Network
from tensegrity.scenes.walls import Wall
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential
from tensegrity.structures.settling import FARTHEST, STEP
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array, Indices


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


Cast: TypeAlias = Annotated[str, ("prestressed", "released")]
STRESSED = 1e-12  # tension over stiffness times length of a member under stress


class Lattice(Cell):
    """Nodes joined by bars and strings, in a cell that repeats.

    Parameters
    ----------
    positions : array_like, (nodes, dim)
        Positions of the nodes of one cell [m]; dim is 2 or 3.
    vectors : array_like, (d, dim)
        Lattice vectors [m], independent; d is 1 (strip, column), 2 (plate) or 3 (solid).
    bars, strings : sequence of (int, int, offset)
        The nodes that each member joins, and the offset of the second one's cell: d integers, or
        an integer for d = 1; (i, j) lies in one cell.  A member and its reverse are the same and
        are given once; members that are given several times alike are parallel.  Arrays hold bars
        first, then strings.
    k_bar, k_string : float or array_like, (bars,) or (strings,), optional
        Spring constants, EA over natural length [N/m], > 0; by default 100 and 1.
    mass : float or array_like, (nodes,), optional
        At the nodes [kg], > 0; by default 1.  Where members have mass >= 0, and by default 0.
    natural_lengths : array_like, (members,), optional
        Unstressed lengths [m]; by default the lengths at the positions.  A spring of natural
        length 0 may join nodes at one place, such as a mass within a mass: it resists alike in all
        directions, with its stiffness.
    buckling : float or array_like, (bars,), optional
        Loads at which bars buckle [N], > 0; by default none does.
    plateau : float, optional
        Stiffness of a bar after buckling over that before, >= 0 and < 1.
    EA_bar, EA_string : float or array_like, (bars,) or (strings,), optional
        Axial stiffnesses [N], > 0, instead of k_bar, k_string; see `Structure`.
    bar_mass, string_mass : float or array_like, (bars,) or (strings,), optional
        Mass of each bar and string [kg], >= 0, uniform along it; by default 0, which lumps all
        masses at the nodes (see the notes of `Structure`).

    Attributes
    ----------
    positions, vectors, stiffnesses, natural_lengths, mass, member_mass : ndarray
    ends, offsets : ndarray of int, (members, 2) and (members, d)
    is_string, slack, buckled : ndarray of bool, (members,)

    Raises
    ------
    TensegrityError
        If the vectors are dependent, an offset is not d integers, a member has no length or is
        given from both ends, both k and EA of bars or strings are given, a node is in no member or
        without mass, or a number is outside its bounds.

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
        of, rows = Strained(start, free), start._rows
        x, left = settle(of, rows if free else rows[: self.nodes])
        refuse_unbalanced(of, x, left)
        relaxed = start.at(x[: self.nodes], x[self.nodes :] if free else None)
        carry = np.abs(relaxed.tensions) > STRESSED * self.stiffnesses * self.natural_lengths
        if free and not carry.any() and relaxed.strings:
            raise EquilibriumError(
                "these natural lengths leave all members without stress, at free lattice vectors: "
                "no prestress holds a shape"
            )
        return relaxed

    def stability(self) -> Stability:
        """Whether the lattice is stable about its own state, by three tests.

        Waves on a grid of the Brillouin zone, the lowest of which are refined; long waves, which a
        grid misses, by the acoustic tensor; and uniform strain under constant stress.

        Returns
        -------
        Stability

        Raises
        ------
        EquilibriumError
            As `moduli`.

        Examples
        --------
        A triangular lattice of springs is stable under moderate compression only:

        >>> from tensegrity import Lattice
        >>> pairs = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, -1))]
        >>> tri = Lattice([(0, 0)], [(1, 0), (0.5, 0.75**0.5)], bars=pairs, k_bar=1)
        >>> for f in (0.8, 0.7):
        ...     print(tri.equilibrium([[f, 0], [0, f]]).stability().kind)
        stable
        long wave, wave, strain
        """
        return stability(self)

    @checked
    def embedded(
        self,
        matrix: Matrix,
        cast: Cast = "prestressed",
        mesh: Any = None,
    ) -> Embedded:
        """The lattice in a matrix, cast about its state.

        Parameters
        ----------
        matrix : Matrix
            Without a `radius` it is bonded everywhere and follows uniform strain, for long waves;
            with one, nodes are rigid patches in finite elements.
        cast : {"prestressed", "released"}, optional
            Whether the macroscopic stress at casting is kept; or is released, so that the lattice
            shortens and stresses the matrix, to first order.
        mesh : int, path or skfem.Mesh, optional
            With a `radius`: number of elements from a patch to each face of its Voronoi cell, and
            along each edge of the faces; or a periodic mesh of linear elements of one cell, from a
            file of any format of meshio, with the patches or without.

        Returns
        -------
        Embedded

        Raises
        ------
        TensegrityError
            One of `radius` and `mesh` without the other, patches that overlap or are smaller than
            an element, a mesh that is not periodic, a lattice that does not fill space, or an
            extra that is not installed.
        EquilibriumError
            The nodes are not in equilibrium, or a string slackens in the release.

        Examples
        --------
        Strings of force .4 N, released in a soft and in a stiff matrix, lose a third and little:

        >>> from tensegrity import Lattice, Matrix
        >>> net = Lattice([(0, 0)], [(1, 0), (0, 1)], bars=[(0, 0, (1, 1)), (0, 0, (1, -1))],
        ...               strings=[(0, 0, (1, 0)), (0, 0, (0, 1))], k_bar=1.5, k_string=2,
        ...               natural_lengths=[2**0.5, 2**0.5, 0.8, 0.8])
        >>> for modulus in (0.1, 10):
        ...     cast = net.embedded(Matrix(modulus, 0.45, 0.5), cast="released")
        ...     print(round(cast.lattice.tensions[2], 4), cast.strain[0, 0].round(4))
        0.2594 -0.0703
        0.3892 -0.0054
        """
        return embedded(self, matrix, cast, mesh)

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
        check.memory(f"{check.shown(shape)} cells", 1e3 * len(self.ends) * float(math.prod(shape)))
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
            **self._copied(copies, len(cells)),
        )

    def tile(self, counts: Any) -> Structure:
        """A block of cells as a free structure, with the members whose two ends are inside.

        Parameters
        ----------
        counts : sequence of int, (d,), or int where d = 1
            Number of cells along each vector.

        Returns
        -------
        Structure
            Nodes and members in the order of `repeated`.  Its border is not in equilibrium:
            see `Structure.relaxed`.
        """
        for m in np.flatnonzero(self.natural_lengths == 0):
            raise TensegrityError(
                f"{self.name_of(int(m))} has natural length 0 m, must be above 0 in a Structure: "
                "place its nodes apart along the axis of their motion"
            )
        shape, cells, ends, many = self._copies(counts)
        copies = []
        for m, second in enumerate(ends):
            inside = np.all((second >= 0) & (second < many), axis=1)
            copies.append([tuple(p) for p in self._numbered(shape, m, second % many)[inside]])
        return Structure(
            (self.positions + (cells @ self.vectors)[:, None]).reshape(-1, self.dim),
            **self._copied(copies, len(cells)),
        )

    def network(
        self,
        counts: Any,
        *,
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
        forces: Sequence[Force] = (),
        natural_lengths: Mapping[int, Any] | None = None,
        walls: Sequence[Wall] = (),
        wall_law: Potential | float | None = None,
        gravity: float = 0.0,
    ) -> Network:
        """A block of cells for `simulate`, in equilibrium, with its border held.

        Parameters
        ----------
        counts : sequence of int, (d,), or int where d = 1
            Number of cells along each vector.
        drive, damping, forces : optional
            As of `Network`; a driven node is not held.
        natural_lengths : dict, optional
            {member: expression of t}, of members numbered as those of `tile`; see
            `Structure.network`.
        walls, wall_law, gravity : optional
            As of `Structure.network`.

        Returns
        -------
        Network
            Nodes in the order of `repeated`; those with a member that leaves the block are held.
            For a free border see `tile`.

        Raises
        ------
        TensegrityError
        """
        shape, _, ends, many = self._copies(counts)
        border = set()
        for m, second in enumerate(ends):
            out = np.any((second < 0) | (second >= many), axis=1)
            pairs = self._numbered(shape, m, second % many)
            border |= set(pairs[out][:, 0].tolist()) | set(pairs[out][:, 1].tolist())
        moved = set(drive) if isinstance(drive, Mapping) else set()
        held = sorted(border - moved)
        given: dict[str, Any] = {"drive": drive, "damping": damping, "forces": forces}
        given |= {"walls": walls, "wall_law": wall_law, "gravity": gravity}
        return self.tile(counts).network(held=held, natural_lengths=natural_lengths, **given)

    def _copied(self, copies: list[list[Any]], cells: int) -> dict[str, Any]:
        """Values given for each member and node, repeated for their copies."""
        numbers = [len(each) for each in copies]
        mass = np.repeat(self.member_mass, numbers)
        flat = [p for each in copies for p in each]
        in_bars, in_strings = numbers[: self.bars], numbers[self.bars :]
        stiff = {
            name: np.repeat(value, in_bars if name.endswith("bar") else in_strings)
            for name, value in self._stiff_unless({}).items()
        }
        bars = sum(in_bars)
        return {
            "bars": flat[:bars],
            "strings": flat[bars:],
            **stiff,
            "natural_lengths": np.repeat(self.natural_lengths, numbers),
            "mass": np.tile(self.mass, cells),
            **({"bar_mass": mass[:bars], "string_mass": mass[bars:]} if mass.any() else {}),
            "buckling": None if self.buckling is None else np.repeat(self.buckling, in_bars),
            "plateau": self.plateau,
        }
