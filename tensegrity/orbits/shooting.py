"""Newton's method for orbits by shooting, with as many steps as an orbit needs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.typing import Array

ITERATIONS, HALVINGS = 60, 8  # of Newton's method, and of one of its steps
LONGEST = 0.3  # step of it over the largest displacement
CONVERGED = 1e-12  # last step of Newton's method over the largest displacement
STUCK = 1e-9  # the same, below which round-off may end the iteration
SETTLED = 1e-9  # change of the unknowns between two numbers of steps, over the largest
FINEST = 4096  # steps of the flow


class NoOrbitError(Exception):  # internal: its words become part of a `TensegrityError`
    """Newton's method did not converge."""


class Shooting:
    """The equations of an orbit in unknowns x; see `settled`.

    Parameters
    ----------
    scene : Chain
    flow : Flow or DrivenFlow
        Whose steps are chosen here.
    """

    def __init__(self, scene: Chain, flow: Any) -> None:
        self.scene, self.flow, self.of = scene, flow, dynamics(scene)

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step from x, and the residual there; nan and inf outside of the springs'
        domains."""
        raise NotImplementedError

    def size(self, step: Array, x: Array) -> float:
        """A change of x over the size of x."""
        raise NotImplementedError

    def refuse(self, x: Array) -> None:
        """Refuse x that is no orbit."""

    def inside(self, u: Array) -> bool:
        """Whether all springs are inside their domains."""
        low, high = self.of.springs.computable_domain[self.of.springs.group].T
        r = np.diff(u)
        return not np.any((r <= low) | (r >= high))

    def settled(self, x: Array, steps: int) -> tuple[Array, float]:
        """The orbit near x and its residual, with as many steps as it needs.

        Parameters
        ----------
        x : ndarray
        steps : int
            At first; they are doubled until x stays.

        Returns
        -------
        x : ndarray
        residual : float

        Raises
        ------
        NoOrbitError
        """
        before = None
        while True:
            self.flow.steps = steps
            x, off = self._solved(x)
            moved = math.inf if before is None else self.size(x - before, x)
            if moved < SETTLED or steps >= FINEST:
                return x, off
            steps, before = min(2 * steps, FINEST), x

    def _solved(self, x: Array) -> tuple[Array, float]:
        """Newton's method with a fixed number of steps of the flow."""
        best = math.inf
        step, off = self.step(x)
        for _ in range(ITERATIONS):
            size = self.size(step, x)
            if not size < math.inf:
                raise NoOrbitError("Newton's method leaves the domain of the springs")
            if size < CONVERGED or (size < STUCK and size > best / 4):
                self.refuse(x + step)
                return x + step, off
            best, part = min(best, size), min(1.0, LONGEST / size)
            for _ in range(HALVINGS):
                tried = x + part * step
                step_there, off_there = self.step(tried)
                if off_there < 2 * off + STUCK:
                    break
                part /= 2
            x, step, off = tried, step_there, off_there
            self.refuse(x)
        raise NoOrbitError(f"the last Newton step is {size:.1e} of the displacements")
