"""Periodic orbits, and Newton's method for them by shooting, with as many steps as required."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import FixedDict
from tensegrity.runs.integrate import simulate
from tensegrity.runs.run import Run
from tensegrity.scenes.acting import per_coordinate
from tensegrity.scenes.dynamics import dynamics, varied
from tensegrity.scenes.forcing import refuse_heavy_bonds
from tensegrity.scenes.scene import Scene, State
from tensegrity.structures.supports import orthonormal, rigid_motions
from tensegrity.typing import Array

Multipliers: TypeAlias = NDArray[np.complex128]

ITERATIONS, HALVINGS = 60, 8  # of Newton's method, and of one of its steps
LONGEST = 0.3  # step of it over the largest displacement
CONVERGED = 1e-12  # last step of Newton's method over the largest displacement
STUCK = 1e-9  # the same: below it the iteration may end by round-off
SETTLED = 1e-9  # change of the unknowns when the steps are doubled, over the largest
FINEST = 4096  # steps of the flow
STABLE = 1e-6  # excess of the modulus of a multiplier over 1 that is round-off
FIXED = 1e-9  # fraction of a motion that counts as zero


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Printed):
    """A time-periodic motion, computed by `periodic_orbit`.

    Attributes
    ----------
    scene : Scene
    state : State
        For a driven or damped scene the state at t = 0; else at rest, at the turning point nearer
        to the guess.
    period : float
        [s]
    energy : float
        Energy above that at rest [J].
    residual : float
        For a driven or damped scene the largest change of the state in a period, relative to the
        state; else the largest |v| at half the period over the largest |v| of linear motion with
        the same displacements and period.
    opens : bool
        Whether some spring passes a kink, such as the loss of contact: fewer digits are exact.
    steps : int
        Number of steps of a period for a driven or damped scene, else of half a period.
    """

    scene: Scene = field(repr=False)
    state: State = field(repr=False)
    period: float
    energy: float
    residual: float
    opens: bool
    steps: int = field(repr=False)

    def _lines(self) -> Lines:
        of = f"periodic orbit of {self.scene.sites} sites"
        yield f"{of}, period {self.period:.6g} s, energy {self.energy:.6g} J"
        yield f"residual {self.residual:.1e}" + "; springs pass kinks" * self.opens

    def run(self, tol: float = 1e-9) -> Run:
        """A run of one period from `state`; arguments as of `simulate`."""
        return simulate(self.scene, self.state, self.period, tol=tol)


def descending(multipliers: Multipliers) -> Multipliers:
    """Multipliers in descending modulus."""
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def is_reversible(scene: Scene) -> bool:
    """Whether all forces have a potential that does not depend on time."""
    of = dynamics(scene)
    driven = scene.drive or scene.damping or of.springs.changing
    return all(one.stores for one in of.further_forces) and not driven


class NoOrbitError(Exception):  # internal: its words become part of a `TensegrityError`
    """Newton's method did not converge."""


class Shooting:
    """The equations of a family of orbits in unknowns x (m,).  The last one is held by
    Newton's method, and followed by `orbit_path`.

    Parameters
    ----------
    scene : Scene
    flow : Flow or DrivenFlow
        Its number of steps is chosen here.

    Attributes
    ----------
    inverse_mass : ndarray, (entries,)
        [1/kg], 0 at held sites.
    rest : ndarray, shape of the scene
        Displacements at rest without drives [m].
    free : ndarray of int
        Entries that move freely.
    guess : ndarray, (m,)
        Unknowns to begin with.
    scale : ndarray, (m - 1,)
        Sizes of all unknowns but the last.
    kinds : tuple of str
        Of the events that multipliers have along the family.
    count : int
        Most values of `distances` for each of these.
    longest : float
        Step along the family, relative: what changes and changes back within one is not seen.
    closed : float
        Residual that twice as many steps may leave, over the size of the orbit.
    """

    def __init__(self, scene: Scene, flow: Any) -> None:
        refuse_heavy_bonds(scene, "periodic orbits")
        self._last: tuple[Any, Any] = None, None
        self.scene, self.flow, self.of = scene, flow, dynamics(scene)
        self.inverse_mass = per_coordinate(scene, self.of.inverse_mass).ravel()
        self.rest = varied(scene, drive=FixedDict()).at_rest().u
        self._least = scene.energy(State(self.rest, 0 * self.rest))

    def evaluated(self, x: Array) -> tuple[Array, Array, Any]:
        """Residual (m - 1,) over its size, its Jacobian (m - 1, m), and the tangent of a period if
        it is known; nan outside of the springs' domains."""
        raise NotImplementedError

    def found(self, x: Array) -> tuple[Array, Array, Any]:
        """The result of `evaluated`, computed once for the last unknowns."""
        key = self.flow.steps, x.tobytes()
        if self._last[0] != key:
            self._last = key, self.evaluated(x)
        return self._last[1]

    def size(self, step: Array, x: Array) -> float:
        """A change of all unknowns but the last over their size."""
        raise NotImplementedError

    def refuse(self, x: Array) -> None:
        """Refuse an x that is not an orbit."""

    def inside(self, u: Array) -> bool:
        """Whether the scene can have these displacements, (entries,), and all springs are inside
        their domains."""
        low, high = self.of.springs.computable_domain[self.of.springs.group].T
        u = u.reshape(self.scene.shape)
        r = self.of.elongations(u)
        if not np.all((low < r) & (r < high)):
            return False
        try:
            if self.of.clearance is not None:
                self.of.clearance.check(u)
        except TensegrityError:
            return False
        return True

    def above_rest(self, u: Array, v: Array) -> float:
        """Energy [J] of a state, (entries,), above that at rest."""
        state = State(u.reshape(self.scene.shape), v.reshape(self.scene.shape))
        return self.scene.energy(state) - self._least

    def forces(self, u: Array) -> Array:
        """Forces at displacements [N], (entries,)."""
        return self.scene.forces(u.reshape(self.scene.shape)).ravel()

    def settled(self, x: Array, steps: int) -> Array:
        """The unknowns of the orbit near x, with as many steps as required.

        Parameters
        ----------
        x : ndarray, (m,)
        steps : int
            Initial number of steps, doubled until x no longer changes.

        Returns
        -------
        ndarray, (m,)

        Raises
        ------
        NoOrbitError
        """
        before = None
        while True:
            self.flow.steps = steps
            x = self._solved(x)
            moved = math.inf if before is None else self.size((x - before)[:-1], x)
            if moved < SETTLED or steps >= FINEST:
                return x
            steps, before = min(2 * steps, FINEST), x

    def _step(self, x: Array) -> tuple[Array, float]:
        """Newton's step from x, and the residual there; nan and inf outside of the springs'
        domains."""
        residual, jacobian, _ = self.found(x)
        if not np.isfinite(residual).all():
            return residual, math.inf
        step = np.asarray(np.linalg.solve(jacobian[:, :-1], -residual), dtype=float)
        return step, float(np.abs(residual).max())

    def _solved(self, x: Array) -> Array:
        """Newton's method with a fixed number of steps of the flow."""
        best = math.inf
        step, off = self._step(x)
        for _ in range(ITERATIONS):
            size = self.size(step, x)
            if not size < math.inf:
                raise NoOrbitError("Newton's method leaves the domain of the springs")
            if size < CONVERGED or (size < STUCK and size > best / 4):
                x = x + np.append(step, 0.0)
                self.refuse(x)
                return x
            best, part = min(best, size), min(1.0, LONGEST / size)
            for _ in range(HALVINGS):
                tried = x + np.append(part * step, 0.0)
                step_there, off_there = self._step(tried)
                if off_there < 2 * off + STUCK:
                    break
                part /= 2
            x, step, off = tried, step_there, off_there
            self.refuse(x)
        raise NoOrbitError(f"the last Newton step is {size:.1e} of the displacements")


def symmetries(scene: Scene, u: Array) -> Array:
    """Rigid motions of a whole scene that change neither its contacts nor the energy of its loads;
    with a pair law, uniform shifts of its free coordinates.

    Parameters
    ----------
    scene : Scene
    u : ndarray, (entries,)
        Displacements at which it is moved [m].

    Returns
    -------
    ndarray, (entries, motions)
        Orthonormal.
    """
    dim, sites = scene.dim, scene.sites
    at = u.reshape(sites, dim) + getattr(scene, "positions", 0.0)
    free = getattr(dynamics(scene), "free", None)  # of a pair law
    rigid = sites > 1 and free is None
    motions = rigid_motions(at) if rigid else np.tile(np.eye(dim), (sites, 1))
    loads = np.broadcast_to(scene.loads, scene.shape).reshape(sites, dim)
    walls: Any = getattr(scene, "walls", ())
    touched = np.unique(getattr(scene, "wall_contacts", np.zeros((0, 2), int))[:, 1])
    normals = np.reshape([walls[wall].normal for wall in touched], (-1, dim))
    held = motions.reshape(sites, dim, -1)[list(scene.held)].reshape(-1, motions.shape[1])
    rows, turning = [held], motions.shape[1] - dim
    if free is not None:
        rows.append(np.eye(dim)[~free])
    for kept, pulled in ((normals, normals), (loads[loads.any(axis=1)], loads.sum(axis=0)[None])):
        rows.append(np.hstack([pulled, np.zeros((len(pulled), turning))]))
        if len(kept) and turning:  # vectors that a rotation must not turn
            turned = rigid_motions(np.concatenate([kept, -kept]))[:, dim:]
            rows.append(np.hstack([np.zeros((len(turned), dim)), turned]))
    _, sizes, right = np.linalg.svd(np.concatenate(rows))
    rank = int(np.sum(sizes > FIXED * max(1.0, sizes.max(initial=0.0)))) if sizes.size else 0
    generators = motions @ right[rank:].T
    return orthonormal(generators) if generators.size else generators
