"""States of self-stress and mechanisms of a shape, from the singular values of its equilibrium.

With force densities q (tension over length) the nodes are in equilibrium where A q = 0; A holds
differences of coordinates only, no stiffness (Pellegrino & Calladine 1986).  How near to zero a
singular value has to be is a matter of how well a shape is known: a measured one has no
self-stress to round-off, and the gap says by how much it fails.  Which of these states a structure
has is what a user asks for: force densities, or the prestrain of strings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.structures.supports import orthonormal, rigid_motions
from tensegrity.typing import Array, Flags, Indices

ZERO = 1e-11  # singular values below this part of the largest are round-off
LEAST = 1e-9  # force density below which a member counts as without force, of their mean
STEPS = 100
SETTLED = 1e-14
SAME = 1e-9  # force that is left on a node, over those of its members: no self-stress


@dataclass(frozen=True)
class SelfStress:
    """States of self-stress of a shape.

    Attributes
    ----------
    states : ndarray, (count, members)
        Force densities [N/m], tension > 0: orthonormal rows, any combination is a state too.
    singular_values : ndarray, (members,)
        Of the equilibrium matrix [m], the largest first.
    pulls_only : ndarray of bool, (members,)
        Strings.
    """

    states: Array
    singular_values: Array
    pulls_only: Flags

    @property
    def gap(self) -> float:
        """The smallest singular value that is not taken as zero, over the largest.

        Where it is small the shape nearly has one state more: see `Structure.nearest_form`.
        """
        values = self.singular_values
        nonzero = values[values > ZERO * values[0]]
        return float(nonzero[-1] / values[0])

    @cached_property
    def feasible(self) -> Array:
        """A state with bars <= 0 <= strings, (members,), of mean force density 1 N/m.

        Of all it is the one whose weakest member is strongest (linear programming).

        Raises
        ------
        EquilibriumError
            If there is none.
        """
        from scipy.optimize import linprog

        count, members = self.states.shape
        if not count:
            smallest, largest = self.singular_values[-1], self.singular_values[0]
            raise EquilibriumError(
                f"no self-stress: the smallest singular value {smallest:.3g} m is above "
                f"{ZERO:g} of the largest {largest:.3g} m"
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
                "the mean force density the wrong way"
            )
        return np.asarray(answer.x[:-1] @ self.states)


def equilibrium_matrix(positions: Array, ends: Indices) -> Array:
    """A [m], (nodes dim, members): A q are the forces that members exert, less their sign."""
    nodes, dim = positions.shape
    matrix = np.zeros((nodes, dim, len(ends)))
    number = np.arange(len(ends))
    d = positions[ends[:, 1]] - positions[ends[:, 0]]
    matrix[ends[:, 0], :, number] = -d
    matrix[ends[:, 1], :, number] = d
    return matrix.reshape(nodes * dim, len(ends))


def self_stress(positions: Array, ends: Indices, pulls_only: Flags) -> SelfStress:
    """See `Structure.self_stress`."""
    matrix = equilibrium_matrix(positions, ends)
    members = len(ends)
    _, sizes, right = np.linalg.svd(matrix)
    sizes = np.concatenate([sizes, np.zeros(members - len(sizes))])
    return SelfStress(right[sizes <= ZERO * sizes[0]], sizes, pulls_only)


def mechanisms(positions: Array, ends: Indices) -> Array:
    """See `Structure.mechanisms`."""
    nodes, dim = positions.shape
    left, sizes, _ = np.linalg.svd(equilibrium_matrix(positions, ends))
    rank = int(np.sum(sizes > ZERO * sizes[0]))
    free = left[:, rank:]
    inside = orthonormal(free.T @ orthonormal(rigid_motions(positions)))
    rest = np.linalg.svd(inside.T)[2][inside.shape[1] :]
    return (rest @ free.T).reshape(-1, nodes, dim)


def nearest_form(positions: Array, ends: Indices) -> Array:
    """Positions next to these that have a state of self-stress, moved as little as possible.

    Newton's method on A(x) q = 0, |q| = 1, each step the least move from the given shape.
    """
    dim, members = positions.shape[1], len(ends)
    start = equilibrium_matrix(positions, ends)
    q = np.linalg.svd(start)[2][members - 1]
    x, size = positions, np.linalg.norm(start)
    for _ in range(STEPS):
        matrix = equilibrium_matrix(x, ends)
        blocks = q[:, None, None] * np.eye(dim)
        slope = forces.assembled(ends[:, 0], ends[:, 1], blocks, len(x)).toarray()  # of A(x) q in x
        # a change of q across itself makes up for all but this part of the residual
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
        f"no form with self-stress found near the given one: the last of {STEPS} steps moved "
        f"{change:.3g} m"
    )


def checked(structure: Any, force_densities: Any) -> Array:
    """Force densities that are a self-stress, (members,)."""
    q = check.vector("force_densities", force_densities, (len(structure.ends),))
    matrix = equilibrium_matrix(structure.positions, structure.ends)
    left = np.abs(matrix @ q).max()
    size = (np.abs(matrix) @ np.abs(q)).max()
    if left > SAME * size:
        raise EquilibriumError(
            f"these force densities are no self-stress: a force of {left:.3g} N is left, "
            f"beside {size:.3g} N"
        )
    return q


def refuse_pushing(structure: Any, q: Array) -> None:
    """Refuse force densities that strings cannot have: slack, they would leave the rest alone."""
    pushed = np.where(structure.is_string, q, 0.0)
    worst = int(pushed.argmin())
    if pushed[worst] < -SAME * np.abs(q).max():
        raise EquilibriumError(
            f"force density {q[worst]:.6g} N/m of {structure.name_of(worst)} must be at least 0: "
            "strings do not push"
        )


def of_prestrain(structure: Any, prestrain: Any) -> Array:
    """Force densities of which some strings have given prestrains."""
    if not isinstance(prestrain, Mapping) or not prestrain:
        raise TensegrityError(
            f"prestrain {check.shown(prestrain)} must be a dict {{string: value}}"
        )
    stress = structure.self_stress()
    if not len(stress.states):
        return stress.feasible  # says why not
    numbers = [structure.member_number(m) for m in prestrain]
    for number in numbers:
        if not structure.is_string[number]:
            raise TensegrityError(
                f"prestrain of bar {number}: strings are numbered from {structure.bars} to "
                f"{len(structure.ends) - 1}"
            )
    if len(numbers) != len(stress.states):
        raise TensegrityError(
            f"prestrain of {len(numbers)} strings, must be of {len(stress.states)}: that many "
            "states of self-stress has this shape"
        )
    values = np.array(
        [check.number(f"prestrain of string {m}", x, above=-1) for m, x in prestrain.items()]
    )
    wanted = structure.stiffnesses[numbers] * values / (1 + values)
    part = stress.states[:, numbers].T
    if np.linalg.cond(part) > 1e10:
        raise TensegrityError(
            f"the prestrains of strings {', '.join(map(str, numbers))} do not determine the "
            "self-stress: choose others"
        )
    return np.asarray(np.linalg.solve(part, wanted) @ stress.states)
