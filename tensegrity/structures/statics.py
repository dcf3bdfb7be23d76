"""States of self-stress and mechanisms of a shape, by singular values; the softest modes.

With force densities q (tension over length) the nodes are in equilibrium where A q = 0; A contains
differences of coordinates and no stiffness (Pellegrino & Calladine 1986).  On supports, A is that
along the motions B that they permit, B^T A; then the numbers of states and of mechanisms differ by
that of members less that of motions, rigid ones not counted.  A measured shape has no state of
self-stress to round-off; `SelfStress.gap` says how far it is from one.  The user selects a state by
force densities, or by the prestrains of strings or the tensions of members.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.engine import forces
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.frames import Frames
from tensegrity.minimum import complement
from tensegrity.printing import Lines, Printed, span
from tensegrity.structures.member_frames import swinging
from tensegrity.structures.segments import WHOLE, Segments
from tensegrity.structures.supports import Freedom, orthonormal
from tensegrity.typing import Array, Flags, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ZERO = 1e-11  # singular values below this fraction of the largest are round-off
LEAST = 1e-9  # force density, over the mean one, below which a member is unstressed
STEPS = 100
SETTLED = 1e-14


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
        With groups of members, as many as there are groups.
    pulls_only : ndarray of bool, (members,)
        Which members are strings.
    zero : float
        Singular values up to this one count as zero [m].
    of : Structure or Lattice
    permitted : Supports, bool or None
        What `of.mechanisms` takes: the supports, or whether the lattice vectors move.
    """

    states: Array
    singular_values: Array
    pulls_only: Flags
    zero: float
    of: Any = field(repr=False, compare=False)
    permitted: Any = None

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
        if count:
            yield f"  {self._stiffening()}"

    def _stiffening(self) -> str:
        """Whether the feasible state stiffens the mechanisms, in words."""
        try:
            values = self.mechanism_stiffness
        except EquilibriumError:
            return "no state has bars <= 0 <= strings"
        if not values.size:
            return "no mechanisms"
        stiffens = values[0] > ZERO * np.abs(values).max()
        return (
            f"the feasible state {'stiffens' if stiffens else 'does not stiffen'} the mechanism"
            f"{'s' * (len(values) > 1)}: {len(values)} of stiffness {span(values, 'N/m')}"
        )

    @cached_property
    def mechanism_stiffness(self) -> Array:
        """Stiffness that the `feasible` state gives the mechanisms, (mechanisms,) [N/m].

        Eigenvalues in ascending order of sum_m q_m |v_m|^2 over motions of unit norm (product
        force; Pellegrino & Calladine 1986), v_m being the difference of the motions of the ends of
        member m; of cables over nodes, its part across each segment.  Where all are
        positive, prestress stiffens every mechanism; where one is negative the shape leaves the
        equilibrium along it.
        """
        motions = self.of.mechanisms(self.permitted)
        return np.linalg.eigvalsh(self.of._stiffening(self.feasible, motions))

    @property
    def gap(self) -> float:
        """The smallest singular value that does not count as zero, over the largest.

        If it is small, the shape is close to one with a further state of self-stress; see
        `Structure.nearest_form`.
        """
        values = self.singular_values
        nonzero = values[values > self.zero]
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
            smallest = self.singular_values[-1]
            raise EquilibriumError(
                f"no self-stress: the smallest singular value {smallest:.3g} m must be at most "
                f"{self.zero:.3g} m; give the supports, or see Structure.nearest_form"
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


def null_states(
    matrix: Array,
    of: Any,
    permitted: Any,
    tied: Array | None = None,
    tolerance: float = ZERO,
) -> SelfStress:
    """The force densities without resultant of an equilibrium matrix.

    Parameters
    ----------
    matrix : ndarray, (rows, members)
        [m]
    of, permitted
        As of `SelfStress`.
    tied : ndarray, (members, groups), optional
        Orthonormal force densities, one column for each group of members.
    tolerance : float, optional
        Singular values up to this fraction of the largest count as zero, or of the longest member:
        all of a matrix along permitted motions may be round-off.

    Returns
    -------
    SelfStress
    """
    matrix = matrix if tied is None else matrix @ tied
    _, sizes, right = np.linalg.svd(matrix)
    sizes = np.concatenate([sizes, np.zeros(matrix.shape[1] - len(sizes))])
    zero = tolerance * float(max(sizes.max(), of.lengths.max()))
    states = right[sizes <= zero]
    states = states if tied is None else states @ tied.T
    turned = states @ np.where(of.is_string, 1.0, -1.0) < 0
    states = np.where(turned[:, None], -states, states)
    return SelfStress(states, sizes, of.is_string, zero, of, permitted)


def of_equal_tensions(shape: Any, groups: Any) -> Array:
    """Orthonormal force densities, (members, groups): the members of a group have equal tensions,
    and each one of no group is its own.

    Parameters
    ----------
    shape : Structure
    groups : sequence of sequences of int
        Members.

    Returns
    -------
    ndarray, (members, groups)

    Raises
    ------
    TensegrityError
    """
    listed = [
        [shape.member_number(m) for m in check.sequence("group", group, "members")]
        for group in check.sequence("groups", groups, "sequences of members")
    ]
    count = np.bincount([m for group in listed for m in group], minlength=len(shape.ends))
    if count.max() > 1:
        raise TensegrityError(f"member {count.argmax()} is in two groups, must be in one at most")
    listed = [group for group in listed if group] + np.flatnonzero(count == 0)[:, None].tolist()
    tied = np.zeros((len(shape.ends), len(listed)))
    for column, group in enumerate(listed):
        tied[group, column] = 1 / shape.lengths[group]
    return np.asarray(tied / np.linalg.norm(tied, axis=0))


def free_motions(matrix: Array, rigid: Array, length: float) -> Array:
    """Orthonormal motions, (count, rows), that change no length and are no rigid ones.

    Parameters
    ----------
    matrix : ndarray, (rows, members)
        Equilibrium matrix [m].
    rigid : ndarray, (rows, motions)
        Orthonormal rigid motions.
    length : float
        Of the longest member [m].

    Returns
    -------
    ndarray, (count, rows)
    """
    left, sizes, _ = np.linalg.svd(matrix)
    free = left[:, int(np.sum(sizes > ZERO * sizes.max(initial=length))) :]
    return np.asarray(complement(orthonormal(free.T @ rigid)).T @ free.T)


def nearest_form(
    positions: Array, ends: Indices, freedom: Freedom, segments: Segments = WHOLE
) -> Array:
    """The nearest positions that admit a self-stress.

    Newton's method on A(x) q = 0, |q| = 1; each step makes the distance from the given shape least.
    Each segment of a cable over nodes, along a unit vector u, changes the forces by its tension
    times (I - u u^T)/length.

    Parameters
    ----------
    positions : ndarray, (nodes, dim)
        [m]
    ends : ndarray of int, (members, 2)
    freedom : Freedom
        The motions by which the positions may change.
    segments : Segments, optional
        As of `equilibrium_matrix`.

    Returns
    -------
    ndarray, (nodes, dim)
        [m]

    Raises
    ------
    EquilibriumError
    """
    motions = freedom.motions
    start = equilibrium_matrix(positions, ends, segments=segments)
    members = start.shape[1]
    q = np.linalg.svd(motions.T @ start)[2][members - 1]
    x, size = positions, np.linalg.norm(start)
    for _ in range(STEPS):
        matrix = motions.T @ equilibrium_matrix(x, ends, segments=segments)
        blocks = forces.of_both_ends(_blocks(x, ends, segments, q))
        # of A(x) q in x
        slope = freedom.reduced(forces.assembled(ends[:, 0], ends[:, 1], blocks, len(x))).toarray()
        # a change of q orthogonal to q compensates all but this component of the residual
        out = np.linalg.svd(matrix)[0][:, members - 1 :]
        moved = motions.T @ (x - positions).ravel()
        residual = out.T @ (matrix @ q - slope @ moved)
        target = -np.linalg.lstsq(out.T @ slope, residual, rcond=1e-10)[0]
        new = positions + (motions @ target).reshape(x.shape)
        change = np.linalg.norm(new - x)
        x = new
        q = np.linalg.svd(motions.T @ equilibrium_matrix(x, ends, segments=segments))[2][
            members - 1
        ]
        if change <= SETTLED * size:
            return x
    raise EquilibriumError(
        f"no shape with self-stress found near the given one: the last of {STEPS} steps moved "
        f"{change:.3g} m"
    )


def _blocks(x: Array, ends: Indices, segments: Segments, q: Array) -> Array:
    """How the force of each segment changes with the difference of its ends at constant q, but for
    changes along the columns of A, (segments, dim, dim)."""
    blocks = segments.each(q)[:, None, None] * np.eye(x.shape[1])
    if segments.owner is None:
        return np.asarray(blocks)
    d = x[ends[:, 1]] - x[ends[:, 0]]
    lengths = np.linalg.norm(d, axis=1)
    density = segments.each(q * segments.over(lengths)) / lengths
    turning = forces.tangents(d / lengths[:, None], np.zeros(len(d)), density)
    return np.where(segments.shared[:, None, None], turning, blocks)


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

    def _moved(self, number: int) -> tuple[Array, str]:
        """The displacements of a mode that are shown [m], (nodes, dim), and its name."""
        number = check.whole("number", number, least=0, below=len(self))
        size = float(np.ptp(self.structure.positions, axis=0).max())
        name = f"mode {number + 1} of {self.total}: {self.frequencies[number]:.6g} rad/s"
        return SHOWN * size * self.shapes[number], name

    def frames(self, number: int = 0) -> Frames:
        """One period of a mode, by its number from 0, the largest displacement being 0.15 of the
        size of the structure; tensions are those at rest."""
        return swinging(self.structure, *self._moved(number))

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
        motion, name = self._moved(number)
        of = self.structure
        drawn = of.plot(ax)
        factor = plotting.metres(np.ptp(of.positions, axis=0).max())[0]
        moved = factor * (of.positions + motion)
        for ends in of.segments:
            drawn.plot(*moved[ends].T, "-", color="0.6", lw=1.0)
        drawn.set_title(name, fontsize=10)
        return drawn
