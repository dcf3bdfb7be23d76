"""The shape of a structure and its supports: permitted motions, self-stress, mechanisms, prestress.

None of these depends on stiffnesses.  Source: Pellegrino & Calladine 1986; on supports the
equilibrium matrix is that along the permitted motions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.structures import statics
from tensegrity.structures.framework import Framework
from tensegrity.structures.laws import elongation_under
from tensegrity.structures.statics import SelfStress
from tensegrity.structures.supports import Freedom, Supports
from tensegrity.typing import Array

SAME = 1e-9  # largest residual force of a self-stress, over the forces of members
KEPT = 4  # supports of a structure whose permitted motions are kept


class Shape(Framework):
    """Nodes and members on supports; see `Structure`."""

    platforms: tuple[tuple[int, ...], ...]

    @checked
    def freedom(self, supports: Supports | None) -> Freedom:
        """The motions that supports and platforms permit."""
        return self._freedom(supports)

    @cached_property
    def _freedom(self) -> Any:
        at, platforms, parts = self.positions, self.platforms, self.parts
        return lru_cache(KEPT)(partial(Freedom.of, positions=at, platforms=platforms, parts=parts))

    @cached_property
    def parts(self) -> tuple[Any, ...]:
        """Node numbers of each connected component."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        pairs = self.segments
        joined = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(self.nodes,) * 2)
        count, label = connected_components(joined, directed=False)
        return tuple(np.flatnonzero(label == k) for k in range(count))

    def _equilibrium_matrix(self, supports: Supports | None) -> Array:
        """That along the permitted motions [m], (motions, members)."""
        matrix = statics.equilibrium_matrix(
            self.positions, self.segments, segments=self.cable_segments
        )
        if supports is None and not self.platforms:
            return matrix
        return np.asarray(self.freedom(supports).motions.T @ matrix)

    @checked
    def self_stress(
        self,
        supports: Supports | None = None,
        *,
        groups: Sequence[Sequence[int]] | None = None,
        tolerance: Annotated[float, ">= 0", "< 1"] = statics.ZERO,
    ) -> SelfStress:
        """States of self-stress of the shape; they do not depend on the stiffnesses.

        Parameters
        ----------
        supports : Supports, optional
            What they hold needs no balance: their reactions are forces of the state, too.  By
            default none.
        groups : sequence of sequences of int, optional
            Members that have equal tensions, by symmetry.  By default each has its own.
        tolerance : float, optional
            Singular values up to this fraction of the largest count as zero.

        Returns
        -------
        SelfStress

        Raises
        ------
        TensegrityError
            If a support or a group names what does not exist, or a member is in two groups.

        Examples
        --------
        A rope of three pieces between two fixed ends:

        >>> from tensegrity import Structure, held
        >>> places = [(0, 0), (1, 0), (2.5, 0), (3, 0)]
        >>> rope = Structure(places, strings=[(0, 1), (1, 2), (2, 3)])
        >>> stress = rope.self_stress(held([0, 3]))
        >>> tensions = stress.feasible * rope.lengths
        >>> (tensions / tensions[0]).round(6).tolist()
        [1.0, 1.0, 1.0]
        >>> (stress.mechanism_stiffness / tensions[0]).round(6).tolist()
        [1.333333, 3.0]
        """
        matrix = self._equilibrium_matrix(supports)
        tied = None if groups is None else statics.of_equal_tensions(self, groups)
        return statics.null_states(matrix, self, supports, tied, tolerance)

    def mechanisms(self, supports: Supports | None = None) -> Array:
        """Inextensional mechanisms: orthonormal infinitesimal motions that change no length.

        Parameters
        ----------
        supports : Supports, optional
            That permit them; by default none.

        Returns
        -------
        ndarray, (count, nodes, dim)
            Without the rigid motions of connected parts.
        """
        freedom, longest = self.freedom(supports), self.lengths.max()
        matrix = self._equilibrium_matrix(supports)
        motions = statics.free_motions(matrix, freedom.rigid, longest)
        return np.asarray((freedom.motions @ motions.T).T).reshape(-1, *self.positions.shape)

    def nearest_form(self, supports: Supports | None = None) -> Self:
        """The structure at the nearest positions that admit a state of self-stress.

        It serves shapes known from measurement; see `SelfStress.gap`.  The natural lengths become
        the lengths of the new shape.

        Parameters
        ----------
        supports : Supports, optional
            Nodes move as they permit; by default freely.

        Raises
        ------
        EquilibriumError
            If Newton's method finds no such positions near the given ones.
        """
        if len(self.self_stress(supports).states):
            return self
        freedom, cables = self.freedom(supports), self.cable_segments
        near = statics.nearest_form(self.positions, self.segments, freedom, cables)
        return self.at(near, natural_lengths=None)

    @checked
    def prestressed(
        self,
        force_densities: ArrayLike | None = None,
        prestrain: Mapping[int, float] | None = None,
        *,
        tension: Mapping[int, float] | None = None,
        supports: Supports | None = None,
        groups: Sequence[Sequence[int]] | None = None,
    ) -> Self:
        """The same shape with natural lengths for which this shape is a prestressed equilibrium.

        Parameters
        ----------
        force_densities : array_like, (members,), optional
            A state of self-stress, tension over length [N/m], tension > 0.
        prestrain : dict, optional
            {member: (length - natural length)/natural length} for as many strings as there are
            independent states of self-stress; members are numbered bars first.
        tension : dict, optional
            {member: tension [N]} for as many members.
        supports, groups : optional
            As of `self_stress`.

        Returns
        -------
        Structure

        Raises
        ------
        TensegrityError
            If not exactly one of the three is given, or a value is outside its bounds, or the law
            of a member never has its tension.
        EquilibriumError
            If the shape has no self-stress, the force densities are not in equilibrium, a string
            would be compressed, or a bar would buckle.
        """
        return prestress(
            self, lambda: self._equilibrium_matrix(supports),
            lambda: self.self_stress(supports, groups=groups),
            force_densities, prestrain, tension,
        )  # fmt: skip


def prestress(
    shape: Any,
    matrix: Callable[[], Array],
    stress: Callable[[], SelfStress],
    force_densities: Any,
    prestrain: Any,
    tension: Any,
) -> Any:
    """A shape under prestress; see `Structure.prestressed`.

    Parameters
    ----------
    shape : Structure or Lattice
    matrix, stress : callable
        Return the equilibrium matrix along permitted motions [m], and the states to choose from.
    force_densities, prestrain, tension
        One of them.

    Returns
    -------
    Structure or Lattice

    Raises
    ------
    TensegrityError, EquilibriumError
        As `Structure.prestressed`.
    """
    if sum(x is not None for x in (force_densities, prestrain, tension)) != 1:
        raise TensegrityError("give one of force_densities, prestrain and tension")
    if force_densities is None:
        q = _of_given(shape, stress(), prestrain, tension)
    else:
        q = _checked(force_densities, matrix())
    what, unit, size = "force density", "N/m", np.ones(len(q))
    if tension is not None:
        what, unit, size = "tension", "N", shape.lengths
    pushed = np.where(shape.is_string, q, 0.0)
    worst = int(pushed.argmin())
    if pushed[worst] < -SAME * np.abs(q).max():
        raise EquilibriumError(
            f"{what} {q[worst] * size[worst]:.6g} {unit} of {shape.name_of(worst)} must be at "
            "least 0: strings do not push"
        )
    kept = shape.keeps_EA
    least = np.where(kept, -shape.EA, -np.inf)
    strain = np.divide(q * shape.lengths, shape.EA, where=kept, out=np.zeros_like(q))
    with np.errstate(divide="ignore"):
        natural = shape.lengths * np.where(kept, 1 / (1 + strain), 1 - q / shape.stiffnesses)
    for n, law in shape.law.items():
        longer = elongation_under(law, q[n] * shape.lengths[n], shape.name_of(n))
        natural[n] = shape.lengths[n] - longer
    wrong = ~((natural > 0) & (q * shape.lengths > least) | (shape.lengths == 0))
    for n in [n for n in shape.law if wrong[n]]:
        raise TensegrityError(
            f"tension {q[n] * shape.lengths[n]:.6g} N of {shape.name_of(n)} makes its law longer "
            f"by {shape.lengths[n] - natural[n]:.6g} m, must be below its length "
            f"{shape.lengths[n]:.6g} m"
        )
    bad = np.flatnonzero(wrong)
    if bad.size:
        number, times = int(bad[0]), "" if tension is None else " times its length"
        most, least = (x[number] * size[number] for x in (shape.stiffnesses, least / shape.lengths))
        bound = f"below its stiffness{times}, {most:g} {unit}"
        if kept[number]:
            bound = f"above -EA{' over its length' * (not times)}, {least:g} {unit}"
        raise TensegrityError(
            f"{what} {q[number] * size[number]:.6g} {unit} of {shape.name_of(number)} must be "
            f"{bound}"
        )
    made = shape.at(shape.positions, natural_lengths=natural)
    for n in np.flatnonzero(made.buckled):
        load = 0.0 if made.buckling is None else made.buckling[n]
        raise EquilibriumError(
            f"bar {n} would carry {-q[n] * made.lengths[n]:.6g} N, must be below its "
            f"buckling load {load:.6g} N"
        )
    return made


def _checked(force_densities: Any, matrix: Array) -> Array:
    """Force densities [N/m], (members,), checked to be a self-stress."""
    q = check.vector("force_densities", force_densities, matrix.shape[1:])
    left = np.abs(matrix @ q).max(initial=0.0)
    size = (np.abs(matrix) @ np.abs(q)).max(initial=0.0)
    if left > SAME * size:
        raise EquilibriumError(
            f"these force densities are no self-stress: a force of {left:.3g} N is unbalanced, "
            f"forces are up to {size:.3g} N"
        )
    return q


def _of_given(structure: Any, stress: SelfStress, prestrain: Any, tension: Any) -> Array:
    """The force densities [N/m], (members,), at which some strings have given prestrains, or some
    members given tensions [N]."""
    name, given, kind = (
        ("tension", tension, "member") if prestrain is None else ("prestrain", prestrain, "string")
    )
    if not isinstance(given, Mapping) or not given:
        raise TensegrityError(f"{name} {check.shown(given)} must be a dict {{{kind}: value}}")
    if not len(stress.states):
        return stress.feasible  # which raises the reason
    numbers = [structure.member_number(m) for m in given]
    for number in numbers if prestrain is not None else ():
        if not structure.is_string[number]:
            raise TensegrityError(
                f"prestrain of bar {number}: strings are numbered from {structure.bars} to "
                f"{len(structure.ends) - 1}"
            )
    if len(numbers) != len(stress.states):
        raise TensegrityError(
            f"{name} of {len(numbers)} {kind}s, must be of {len(stress.states)}: the shape has "
            "that many states of self-stress"
        )
    above = -np.inf if prestrain is None else -1.0
    values = np.array(
        [check.number(f"{name} of {structure.name_of(n)}", x, above=above)
         for n, x in zip(numbers, given.values(), strict=True)]
    )  # fmt: skip
    part = stress.states[:, numbers].T
    sizes = np.linalg.svd(part, compute_uv=False)
    if sizes[-1] < 1e-10 * np.abs(stress.states).max():
        raise TensegrityError(
            f"the {name}s of {kind}s {', '.join(map(str, numbers))} do not determine the "
            "self-stress: choose others"
        )
    if prestrain is None:
        wanted = values / structure.lengths[numbers]
    else:
        lengths = structure.lengths[numbers]
        wanted = np.where(
            structure.keeps_EA[numbers],
            structure.EA[numbers] * values / lengths,
            structure.stiffnesses[numbers] * values / (1 + values),
        )
        for k, n in enumerate(numbers):
            if n in structure.law:
                longer = lengths[k] * values[k] / (1 + values[k])
                wanted[k] = float(structure.law[n].tension(longer)) / lengths[k]
    return np.asarray(np.linalg.solve(part, wanted) @ stress.states)
