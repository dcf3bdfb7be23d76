"""Small vibrations: modes of a scene about an equilibrium, and bands of a periodic chain.

Both linearise the forces.  A finite scene gives K x = w^2 M x with the sparse stiffness matrix
K of its own `stiffness`.  In a chain of equal cells waves are u(n + 1) = exp(i q) u(n): their
stiffness is B* B, with B the elongations of a cell's springs times the roots of their
stiffnesses, so that w are the singular values of B M^-1/2.  These are right to the round-off of
the largest, also where w goes to zero, while the root of an eigenvalue would lose half the digits.
Source: L. Brillouin, Wave Propagation in Periodic Structures (1946), chapters III and IV.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.minimum import lowest, round_off
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.forcing import driven_entries
from tensegrity.scenes.scene import SMALLEST_MASS, Scene, State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

BOUND = 1e-6  # of the largest stiffness over mass: how far below zero the search starts
AT_REST = 1e-6  # force left on a site of an equilibrium, over those that meet there
MOVED = 1e-9  # the same over the largest stiffness times a length


@dataclass(frozen=True, eq=False)
class Modes:
    """Vibrations of a scene about an equilibrium.

    Attributes
    ----------
    frequencies : ndarray, (count,)
        Angular frequencies [rad/s], ascending; 0 for motions that meet no stiffness.
    shapes : ndarray, (count, *shape of the scene)
        Displacements of each [1/sqrt(kg)]: the sum of m u^2 is 1, the largest entry above 0.
    """

    frequencies: Array
    shapes: Array

    def __len__(self) -> int:
        return len(self.frequencies)


def modes(scene: Scene, about: State | None = None, count: int = 10) -> Modes:
    """The slowest vibrations of a scene.

    Parameters
    ----------
    scene : Scene
        A `Chain`, a `Network`, or what `granular` builds.  Sites that are held, or whose motion a
        drive prescribes, stay; dashpots and forces of a drive do not count.
    about : State, optional
        An equilibrium, its velocities 0; by default the scene at rest.
    count : int, optional
        How many, from the slowest on; all where there are fewer.

    Returns
    -------
    Modes

    Raises
    ------
    TensegrityError
        Bad input.
    EquilibriumError
        The forces at `about` do not balance, or it is unstable.
    """
    if isinstance(scene, Ensemble):
        raise TensegrityError("scene is an Ensemble: ask for the modes of one of its scenes")
    check.kind("scene", scene, Scene)
    count = check.whole("count", count, least=1)
    u = scene.at_rest().u if about is None else _equilibrium(scene, about)
    listed = dynamics(scene).listed(u).scene
    stiffness = listed.stiffness(u)
    _refuse_moving(listed, u, stiffness)
    moves = np.ones(scene.shape, dtype=bool)
    moves[list(scene.held)] = False
    moves.reshape(-1)[driven_entries(scene, True)[0]] = False
    free = np.flatnonzero(moves.ravel())
    count = min(count, free.size)
    mass = np.repeat(scene.mass, moves.size // scene.sites)[free]
    from scipy.sparse import diags_array

    of = stiffness[free][:, free], diags_array(mass)
    squares, vectors = lowest(*of, np.zeros((free.size, 0)), count, BOUND)
    if squares.min(initial=0.0) < 0:
        raise EquilibriumError(
            f"the equilibrium is unstable: the lowest stiffness over mass is below "
            f"{-round_off(*of):.3g} 1/s^2"
        )
    shapes = np.zeros((count, moves.size))
    shapes[:, free] = vectors.T
    largest = shapes[np.arange(count), np.abs(shapes).argmax(axis=1)]
    shapes *= np.sign(largest)[:, None]
    return Modes(np.sqrt(squares), shapes.reshape(count, *scene.shape))


def _equilibrium(scene: Scene, about: State) -> Array:
    check.kind("about", about, State)
    scene.check(about)
    fastest = float(np.max(np.abs(about.v), initial=0.0))
    if fastest:
        raise EquilibriumError(f"velocity {fastest:g} m/s of an equilibrium must be 0")
    return about.u


def _refuse_moving(scene: Scene, u: Array, stiffness: Any) -> None:
    """Refuse displacements at which the forces on some site do not balance."""
    of, left = dynamics(scene), float(np.max(np.abs(scene.forces(u)), initial=0.0))
    tensions = np.abs(of.springs.evaluate("tension", of.elongations(u)))
    meet = float(np.max(tensions, initial=0.0)) + float(np.max(np.abs(scene.loads), initial=0.0))
    lengths = [spring.length or 1.0 for spring in of.springs.different]
    stiffest = float(np.max(stiffness.diagonal(), initial=0.0))
    allowed = AT_REST * meet + MOVED * stiffest * min(lengths, default=1.0)
    if left > allowed:
        raise EquilibriumError(
            f"a force of {left:.6g} N is left on a site, must be at most {allowed:.6g} N: the "
            "state is no equilibrium"
        )


def dispersion(
    springs: Potential | Sequence[Potential],
    masses: float | Sequence[float],
    wavenumbers: ArrayLike,
) -> Array:
    """Angular frequencies of small waves in a periodic chain.

    Parameters
    ----------
    springs : Potential or sequence of Potential
        Of one cell, measured from their equilibrium: spring j joins masses j and j + 1, the last
        one the last mass and the first of the next cell.
    masses : float or sequence of float
        Of one cell [kg], > 0; as many as springs, a single one for all.
    wavenumbers : array_like, (wavenumbers,)
        Phase from one cell to the next [rad].

    Returns
    -------
    ndarray, (wavenumbers, branches)
        [rad/s], ascending in each row; as many branches as masses in a cell.

    Raises
    ------
    TensegrityError
        Bad input; a spring whose stiffness at rest is not a number >= 0.
    """
    given = _cell("springs", springs)
    for number, spring in enumerate(given):
        check.kind(f"spring {number}", spring, Potential)
    stiffness = np.array([float(spring.stiffness(0.0)) for spring in given])
    bad = np.flatnonzero(~(np.isfinite(stiffness) & (stiffness >= 0)))
    if bad.size:
        raise TensegrityError(
            f"stiffness {stiffness[bad[0]]:g} N/m of spring {bad[0]} at rest must be at least 0"
        )
    m = np.array(
        [check.number("mass", x, least=SMALLEST_MASS, unit="kg") for x in _cell("masses", masses)]
    )
    count = max(len(stiffness), len(m))
    if {len(stiffness), len(m)} - {1, count}:
        raise TensegrityError(f"{len(stiffness)} springs and {len(m)} masses make no cell")
    q = check.floats("wavenumbers", wavenumbers)
    if q.ndim != 1:
        raise TensegrityError(f"wavenumbers have shape {q.shape}, must be (wavenumbers,)")
    q = check.vector("wavenumbers", q, q.shape)
    stiffness, m = np.broadcast_to(stiffness, count), np.broadcast_to(m, count)
    elongation = np.zeros((len(q), count, count), dtype=complex)
    each = np.arange(count)
    elongation[:, each, each] = -1
    elongation[:, each, (each + 1) % count] += np.where(
        each == count - 1, np.exp(1j * q)[:, None], 1
    )
    scaled = np.sqrt(stiffness)[:, None] * elongation / np.sqrt(m)
    return np.linalg.svd(scaled, compute_uv=False)[:, ::-1]


def _cell(name: str, given: Any) -> tuple[Any, ...]:
    """What a cell has, a single one for all; at least one."""
    if isinstance(given, (str, bytes, dict)):
        raise TensegrityError(f"{name} {check.shown(given)} must be a sequence")
    many = given.ndim if isinstance(given, np.ndarray) else isinstance(given, Sequence)
    found = tuple(given) if many else (given,)
    if not found:
        raise TensegrityError(f"{name} of a cell are none, must be one or more")
    return found
