"""Periodic orbits, and Newton's method for them by shooting, with as many steps as they need."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tensegrity.runs.integrate import simulate
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

ITERATIONS, HALVINGS = 60, 8  # of Newton's method, and of one of its steps
LONGEST = 0.3  # step of it over the largest displacement
CONVERGED = 1e-12  # last step of Newton's method over the largest displacement
STUCK = 1e-9  # the same, below which round-off may end the iteration
SETTLED = 1e-9  # change of the unknowns between two numbers of steps, over the largest
FINEST = 4096  # steps of the flow


@dataclass(frozen=True, eq=False)
class Orbit:
    """A time-periodic motion, computed by `periodic_orbit`.

    Attributes
    ----------
    scene : Chain
    state : State
        Of a driven or damped chain at t = 0; else at rest, at the turning point that the guess
        lies nearer to.
    period : float
        [s]
    energy : float
        Above that at rest [J].
    residual : float
        Of a driven or damped chain the largest change of the state in a period over its size; else
        the largest |v| at half the period over the largest |v| that linear motion of the same
        displacements and period has.
    opens : bool
        Whether some spring passes a kink, such as the loss of contact: fewer digits then.
    steps : int
        Steps of the period of a driven or damped chain, else of half a period.
    """

    scene: Chain = field(repr=False)
    state: State = field(repr=False)
    period: float
    energy: float
    residual: float
    opens: bool
    steps: int = field(repr=False)

    def __str__(self) -> str:
        opens = "; springs pass kinks" if self.opens else ""
        return (
            f"periodic orbit of {self.scene.sites} sites, period {self.period:.6g} s, energy "
            f"{self.energy:.6g} J\nresidual {self.residual:.1e}{opens}"
        )

    __repr__ = __str__

    def run(self, tol: float = 1e-9) -> Run:
        """A run of one period from `state`, with the tolerance of `simulate`."""
        return simulate(self.scene, self.state, self.period, tol=tol)


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


def above_rest(scene: Chain, state: State) -> float:
    """Energy of a state above that at rest [J]."""
    nothing = np.zeros(scene.sites)
    return scene.energy(state) - scene.energy(State(nothing, nothing))
