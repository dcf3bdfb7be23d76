"""States of self-stress and mechanisms of a shape, by singular values; the softest modes.

With force densities q (tension over length) the nodes are in equilibrium where A q = 0; A contains
differences of coordinates and no stiffness (Pellegrino & Calladine 1986).  A measured shape has no
state of self-stress to round-off; `SelfStress.gap` says how far it is from one.  The user selects
a state by force densities, or by the prestrains of strings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.engine import forces
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.printing import Lines, Printed, span
from tensegrity.structures.segments import WHOLE, Segments
from tensegrity.structures.supports import orthonormal, rigid_motions
from tensegrity.typing import Array, Flags, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ZERO = 1e-11  # singular values below this fraction of the largest are round-off
LEAST = 1e-9  # force density, over the mean one, below which a member is unstressed
STEPS = 100
SETTLED = 1e-14
SAME = 1e-9  # largest residual force of a self-stress, over the forces of members


@dataclass(frozen=True, repr=False)
class SelfStress(Printed):
    """States of self-stress of a shape.

    Attributes
    ----------
    states : ndarray, (count, members)
        Force densities [N/m], tension > 0; the rows are an orthonormal basis of all states, each
        with the sign that makes the sum over strings at least that over bars.
    singular_values : ndarray, (members,)
        Singular values of the equilibrium matrix in descending order [m].
    pulls_only : ndarray of bool, (members,)
        Which members are strings.
    """

    states: Array
    singular_values: Array
    pulls_only: Flags

    def _lines(self) -> Lines:
        count, members = self.states.shape
        strings = int(np.sum(self.pulls_only))
        yield (
            f"{count or 'no'} state{'s' * (count != 1)} of self-stress of {members} members "
            f"({members - strings} bars, {strings} strings)"
        )
        yield f"  gap {self.gap:.3g}: the smallest singular value above zero over the largest"
        for number, state in enumerate(self.states):
            kinds = (("bars", ~self.pulls_only), ("strings", self.pulls_only))
            parts = [f"{name} {span(state[of], 'N/m')}" for name, of in kinds if of.any()]
            yield f"  state {number}: force densities of {', of '.join(parts)}"

    @property
    def gap(self) -> float:
        """The smallest singular value that does not count as zero, over the largest.

        If it is small, the shape is close to one with a further state of self-stress; see
        `Structure.nearest_form`.
        """
        values = self.singular_values
        nonzero = values[values > ZERO * values[0]]
        return float(nonzero[-1] / values[0]) if nonzero.size else 1.0

    @cached_property
    def feasible(self) -> Array:
        """A state with compressed bars and tensioned strings, (members,) [N/m].

        The mean magnitude of the force densities is 1 N/m.  Among all such states the one with
        the largest smallest magnitude is chosen, by linear programming.

        Raises
        ------
        EquilibriumError
            If there is no such state.
        """
        from scipy.optimize import linprog

        count, members = self.states.shape
        if not count:
            smallest, largest = self.singular_values[-1], self.singular_values[0]
            raise EquilibriumError(
                f"no self-stress: the smallest singular value {smallest:.3g} m is above "
                f"{ZERO:g} of the largest {largest:.3g} m; see Structure.nearest_form"
            )
        signed = np.where(self.pulls_only, 1.0, -1.0) * self.states
        least = np.zeros(count + 1)
        least[-1] = -1  # linprog minimises
        answer = linprog(
            least,
            A_ub=np.column_stack([-signed.T, np.ones(members)]),
            b_ub=np.zeros(members),
            A_eq=np.append(signed.sum(axis=1), 0.0)[None, :],
            b_eq=[float(members)],
            bounds=[(None, None)] * count + [(None, None)],
            method="highs",
        )
        if answer.status != 0 or answer.x[-1] < -LEAST:
            raise EquilibriumError(
                f"none of the {count} states of self-stress has bars <= 0 <= strings: at best a "
                f"member carries {answer.x[-1] if answer.x is not None else float('-inf'):.3g} of "
                "the mean force density with the wrong sign"
            )
        return np.asarray(answer.x[:-1] @ self.states)


def equilibrium_matrix(
    positions: Array, ends: Indices, shift: Array | float = 0.0, segments: Segments = WHOLE
) -> Array:
    """Equilibrium matrix A: -A q are the member forces on the nodes.

    Of a cable over nodes q is its tension over its whole length.

    Parameters
    ----------
    positions : ndarray, (nodes, dim)
        [m]
    ends : ndarray of int, (members, 2)
    shift : ndarray, (members, dim), optional
        As of `Members`.
    segments : Segments, optional
        Of which cables over nodes consist; `ends` and `shift` are those of segments then.

    Returns
    -------
    ndarray, (nodes dim, members)
        [m]
    """
    nodes, dim = positions.shape
    matrix = np.zeros((nodes, dim, len(ends)))
    number = np.arange(len(ends))
    d = positions[ends[:, 1]] - positions[ends[:, 0]] + shift
    matrix[ends[:, 0], :, number] = -d
    matrix[ends[:, 1], :, number] = d
    own = ends[:, 0] == ends[:, 1]  # both ends at one node, in different cells
    matrix[ends[own, 0], :, number[own]] = 0
    whole = matrix.reshape(nodes * dim, len(ends))
    if segments.owner is None:
        return whole
    lengths = np.sqrt(np.sum(d**2, axis=1))
    return segments.over(whole / lengths) * segments.over(lengths)


def self_stress(
    positions: Array,
    ends: Indices,
    pulls_only: Flags,
    shift: Array | float = 0.0,
    segments: Segments = WHOLE,
) -> SelfStress:
    """States of self-stress of a shape.

    Parameters
    ----------
    positions : ndarray, (nodes, dim)
        Positions of the nodes [m].
    ends : ndarray of int, (members, 2)
        The two nodes of each member.
    pulls_only : ndarray of bool, (members,)
        Which members are strings.
    shift, segments : optional
        As of `equilibrium_matrix`.

    Returns
    -------
    SelfStress
    """
    return null_states(equilibrium_matrix(positions, ends, shift, segments), pulls_only)


def null_states(matrix: Array, pulls_only: Flags) -> SelfStress:
    """The force densities without resultant of an equilibrium matrix (rows, members) [m]."""
    members = matrix.shape[1]
    _, sizes, right = np.linalg.svd(matrix)
    sizes = np.concatenate([sizes, np.zeros(members - len(sizes))])
    states = right[sizes <= ZERO * sizes[0]]
    turned = states @ np.where(pulls_only, 1.0, -1.0) < 0
    return SelfStress(np.where(turned[:, None], -states, states), sizes, pulls_only)


def free_motions(matrix: Array, rigid: Array) -> Array:
    """Orthonormal motions, (count, rows), that change no length and are no rigid ones.

    Parameters
    ----------
    matrix : ndarray, (rows, members)
        Equilibrium matrix [m].
    rigid : ndarray, (rows, motions)
        Orthonormal rigid motions.

    Returns
    -------
    ndarray, (count, rows)
    """
    left, sizes, _ = np.linalg.svd(matrix)
    free = left[:, int(np.sum(sizes > ZERO * sizes[0])) :]
    inside = orthonormal(free.T @ rigid)
    return np.asarray(np.linalg.svd(inside.T)[2][inside.shape[1] :] @ free.T)


def mechanisms(positions: Array, ends: Indices, segments: Segments = WHOLE) -> Array:
    """Inextensional mechanisms; see `Structure.mechanisms`.

    Parameters
    ----------
    positions, ends, segments
        As of `equilibrium_matrix`.

    Returns
    -------
    ndarray, (count, nodes, dim)
    """
    nodes, dim = positions.shape
    matrix = equilibrium_matrix(positions, ends, 0.0, segments)
    motions = free_motions(matrix, orthonormal(rigid_motions(positions)))
    return motions.reshape(-1, nodes, dim)


def nearest_form(positions: Array, ends: Indices) -> Array:
    """The nearest positions that admit a state of self-stress [m], (nodes, dim).

    Newton's method on A(x) q = 0, |q| = 1; each step makes the distance from the given shape least.
    """
    dim, members = positions.shape[1], len(ends)
    start = equilibrium_matrix(positions, ends)
    q = np.linalg.svd(start)[2][members - 1]
    x, size = positions, np.linalg.norm(start)
    for _ in range(STEPS):
        matrix = equilibrium_matrix(x, ends)
        blocks = forces.of_both_ends(q[:, None, None] * np.eye(dim))
        slope = forces.assembled(ends[:, 0], ends[:, 1], blocks, len(x)).toarray()  # of A(x) q in x
        # a change of q orthogonal to q compensates all but this component of the residual
        out = np.linalg.svd(matrix)[0][:, members - 1 :]
        moved = (x - positions).ravel()
        residual = out.T @ (matrix @ q - slope @ moved)
        target = -np.linalg.lstsq(out.T @ slope, residual, rcond=1e-10)[0]
        new = positions + target.reshape(x.shape)
        change = np.linalg.norm(new - x)
        x = new
        q = np.linalg.svd(equilibrium_matrix(x, ends))[2][members - 1]
        if change <= SETTLED * size:
            return x
    raise EquilibriumError(
        f"no shape with self-stress found near the given one: the last of {STEPS} steps moved "
        f"{change:.3g} m"
    )


def checked(structure: Any, force_densities: Any) -> Array:
    """Force densities [N/m], (members,), checked to be a self-stress of the structure."""
    q = check.vector("force_densities", force_densities, (len(structure.ends),))
    matrix = equilibrium_matrix(
        structure.positions, structure.segments, structure.shift, structure.cable_segments
    )
    left = np.abs(matrix @ q).max()
    size = (np.abs(matrix) @ np.abs(q)).max()
    if left > SAME * size:
        raise EquilibriumError(
            f"these force densities are no self-stress: a force of {left:.3g} N is unbalanced, "
            f"forces are up to {size:.3g} N"
        )
    return q


def refuse_pushing(structure: Any, q: Array) -> None:
    """Refuse compressive force densities of strings."""
    pushed = np.where(structure.is_string, q, 0.0)
    worst = int(pushed.argmin())
    if pushed[worst] < -SAME * np.abs(q).max():
        raise EquilibriumError(
            f"force density {q[worst]:.6g} N/m of {structure.name_of(worst)} must be at least 0: "
            "strings do not push"
        )


def of_prestrain(structure: Any, prestrain: Any) -> Array:
    """The force densities [N/m], (members,), at which some strings have given prestrains."""
    if not isinstance(prestrain, Mapping) or not prestrain:
        raise TensegrityError(
            f"prestrain {check.shown(prestrain)} must be a dict {{string: value}}"
        )
    stress = structure.self_stress()
    if not len(stress.states):
        return stress.feasible  # which raises the reason
    numbers = [structure.member_number(m) for m in prestrain]
    for number in numbers:
        if not structure.is_string[number]:
            raise TensegrityError(
                f"prestrain of bar {number}: strings are numbered from {structure.bars} to "
                f"{len(structure.ends) - 1}"
            )
    if len(numbers) != len(stress.states):
        raise TensegrityError(
            f"prestrain of {len(numbers)} strings, must be of {len(stress.states)}: the shape has "
            "that many states of self-stress"
        )
    values = np.array(
        [check.number(f"prestrain of string {m}", x, above=-1) for m, x in prestrain.items()]
    )
    wanted = np.where(
        structure.keeps_EA[numbers],
        structure.EA[numbers] * values / structure.lengths[numbers],
        structure.stiffnesses[numbers] * values / (1 + values),
    )
    part = stress.states[:, numbers].T
    if np.linalg.cond(part) > 1e10:
        raise TensegrityError(
            f"the prestrains of strings {', '.join(map(str, numbers))} do not determine the "
            "self-stress: choose others"
        )
    return np.asarray(np.linalg.solve(part, wanted) @ stress.states)


SHOWN = 0.15  # of the size of the structure: the largest displacement in a picture


@dataclass(frozen=True, repr=False)
class StructureModes(Printed):
    """The softest modes of a structure, without rigid motions.

    Attributes
    ----------
    eigenvalues : ndarray, (count,)
        Of the tangent stiffness [N/m], the lowest first; one below 0 is an instability, and 0
        where it is round-off.
    frequencies : ndarray, (count,)
        Angular frequencies of small motions [rad/s], the lowest first; below 0 the rate [1/s]
        at which an unstable motion grows.
    shapes : ndarray, (count, nodes, dim)
        Motions that belong to the frequencies, the largest displacement of a node being 1.
    structure : Structure
    total : int
        Number of all modes that the supports leave, of which these are the first.
    """

    eigenvalues: Array
    frequencies: Array
    shapes: Array
    structure: Any = field(repr=False)
    total: int

    def __len__(self) -> int:
        return len(self.frequencies)

    def _lines(self) -> Lines:
        yield f"modes 1 to {len(self)} of {self.total}, without rigid motions"
        rows = zip(self.frequencies, self.eigenvalues, self.shapes, strict=True)
        for number, (frequency, stiffness, shape) in enumerate(rows, 1):
            node = int(np.argmax(np.sum(shape**2, axis=-1)))
            yield (
                f"  {number}: {frequency:.6g} rad/s, stiffness {stiffness:.6g} N/m, "
                f"node {node} moves most"
            )

    def plot(self, ax: Axes | None = None, number: int = 0) -> Axes:
        """Draw a mode: the structure, and in grey where its nodes and members move to.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            As of `Structure.plot`.
        number : int, optional
            Of the mode, from 0.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or there is no such mode.
        """
        number = check.whole("number", number, least=0, below=len(self))
        of = self.structure
        drawn = of.plot(ax)
        size = float(np.ptp(of.positions, axis=0).max())
        factor = plotting.metres(size)[0]
        moved = factor * (of.positions + SHOWN * size * self.shapes[number])
        for ends in of.segments:
            drawn.plot(*moved[ends].T, "-", color="0.6", lw=1.0)
        frequency = self.frequencies[number]
        drawn.set_title(f"mode {number + 1} of {self.total}: {frequency:.6g} rad/s", fontsize=10)
        return drawn
