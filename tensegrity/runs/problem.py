"""What is to be run, and in how many steps at most."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tensegrity.engine.methods import Method
from tensegrity.errors import StabilityError
from tensegrity.runs.stepping import Outlook
from tensegrity.scenes.dynamics import dynamics

MOST_STEPS = 10**12


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be run, the step apart, of which `given` says what a user asked for [s].

    `surrogate` is the scene with springs that are fitted to those of `scene`: it is moved, while
    checks and recorded energies are those of `scene`.  `choice` says what chose the step: "dt",
    "tol" or "default".  Of a trial `rows` may be left out.  The `outlook` is that of the scene and
    the state.  `observe` are pairs of a user's function and a record that says when it is called,
    `tuning` are springs in time that the scene does not say itself, and `bind` is what binds arrays
    u, v to a method and a step [s], if that is not the scene.
    """

    scene: Any
    state: Any
    t_end: float
    method: Method
    record: Any
    surrogate: Any = None
    choice: str = "dt"
    rows: bool = True
    outlook: Outlook | None = None
    given: float | None = None
    observe: tuple[Any, ...] = ()
    tuning: Any = None
    bind: Any = None

    def __post_init__(self):
        if self.outlook is None:
            object.__setattr__(self, "outlook", Outlook(self.dynamics, self.state))

    @property
    def dynamics(self):
        """That of the scene."""
        return dynamics(self.scene)

    @property
    def moved(self):
        """That of what the loop advances."""
        return dynamics(self.scene if self.surrogate is None else self.surrogate)

    @property
    def is_forced(self):
        """Whether time counts."""
        return self.dynamics.is_driven or self.tuning is not None

    @property
    def force(self):
        """What the tensions of the springs are computed by."""
        return self.moved.springs.force

    def largest_step(self, omega):
        """Stability limit [s] at an angular frequency [rad/s]; inf where it is 0."""
        return self.method.stability_limit / omega if omega > 0 else math.inf

    def step_words(self, dt):
        """A step as it was given, and what it became to divide the time evenly."""
        if self.given is None or math.isclose(self.given, dt, rel_tol=1e-5):
            return f"dt {dt:.6g} s"
        return f"dt {self.given:.6g} s, that is steps of {dt:.6g} s,"

    def natural_step(self, omega):
        """The step [s] that fractions are taken of, at an angular frequency [rad/s]."""
        return self.method.scale / omega if omega > 0 else math.inf


def count(problem, dt):
    """Number of steps, the largest not above dt; refused where no run could end."""
    steps = problem.t_end / dt * (1 - 1e-12) if dt > 0 else math.inf
    if steps > MOST_STEPS:
        raise StabilityError(
            f"t_end {problem.t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than "
            f"{MOST_STEPS:.0e}"
        )
    return math.ceil(steps)
