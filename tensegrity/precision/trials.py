"""Runs of one scene with given numbers of steps, and the reference that their errors refer to.

A run here is the march of `simulate` without rows.  The error of its last state is
max(|du|/max|u|, |dv|/max|v|), maxima over the reference run.  The reference is the finest run of
the method best suited to the scene; its own error is its difference from runs of another method,
refined together with it until the difference no longer decreases.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.engine.methods import METHODS, RK8, Corrected, Method, Splitting, default, find
from tensegrity.errors import (
    ContactError,
    LockingError,
    StabilityError,
    TensegrityError,
)
from tensegrity.runs.march import march
from tensegrity.runs.problem import AprioriBounds, Problem
from tensegrity.runs.record import PLAIN
from tensegrity.runs.step import steps_at
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

FAILED = ContactError, LockingError, StabilityError
FIRST, MOST_LEVELS = 0.3, 14  # the first step of references over the stability limit, refinements
FEWEST, INSTANTS, ENTRIES = 17, 64, 2_000_000  # steps, instants and numbers of a reference's states
EXACT = 2e-14  # own error of a reference that is not refined any more
NEWTON = 10  # force evaluations of a step of the midpoint rule, as its `limitations` say
EXTENDED = 0.014  # twice the step in long double over the stability limit
TINY = 1e-6  # of the run: a step that shows whether a method takes a scene


def composed(order: int, parts: tuple[float, ...] = (1.0,)) -> tuple[float, ...]:
    """Suzuki's steps of an even order, composed of those of the order two below."""
    a = 1 / (4 - 4 ** (1 / (order - 1)))
    parts = parts if order == 4 else composed(order - 2)
    return tuple(x * y for x in (a, a, 1 - 4 * a, a, a) for y in parts)


def suzuki(order: int) -> Splitting:
    """Suzuki's symmetric composition of steps of Verlet: M. Suzuki, Phys. Lett. A 146, 319 (1990).

    It serves as the other method that shows the error of a reference: its coefficients follow from
    its order alone, and have nothing in common with those of `METHODS`.
    """
    parts = composed(order)
    kicks = tuple((x + y) / 2 for x, y in zip((0, *parts), (*parts, 0), strict=True))
    return Splitting(f"suzuki{order}", order, 0.1, kicks, parts)


class Trial(NamedTuple):
    """The end of a run, its cost, and the march that it was."""

    u: Array
    v: Array
    steps: int
    evaluations: int
    seconds: float
    march: Any


class Reference(NamedTuple):
    """The last state that is taken as true, the error that it has itself, and where it is from."""

    u: Array
    v: Array
    error: float
    words: str


class Trials:
    """Runs of a scene.

    Parameters
    ----------
    scene, state, t_end
        As of `simulate`.
    seconds : float
        Of CPU time that all runs may take [s].

    Attributes
    ----------
    scale : ndarray, (2,)
        Largest |u| [m] and |v| [m/s] of the reference run.
    fastest : float
        Bound on the angular frequency over the elongations that it reached [rad/s].
    samples : ndarray, (2, instants + 1, *shape)
        Its u and v.
    """

    def __init__(self, scene: Any, state: State, t_end: float, seconds: float) -> None:
        self.scene, self.state, self.t_end = scene, state, t_end
        self.dynamics = dynamics(scene)
        self.bounds = AprioriBounds(self.dynamics, state)
        self._began, self.seconds = time.process_time(), seconds
        self.scale, self.fastest, self.samples = np.ones(2), 0.0, np.zeros((2, 0))

    def used(self) -> float:
        """The fraction of the time allowed that has passed; compilers take none of it."""
        return (time.process_time() - self._began) / self.seconds

    def _problem(self, method: Method, state: State | None = None, t_end: float = 0.0) -> Problem:
        """What a run solves, with another initial state or duration if given."""
        of = self.dynamics
        return Problem(
            self.scene,
            state or self.state,
            t_end or self.t_end,
            method,
            PLAIN,
            choice="tol",
            rows=False,
            a_priori=self.bounds,
            dynamics=of,
            loop_dynamics=of,
        )

    def run(
        self,
        method: Method,
        steps: int,
        allowed: float = 1.0,
        instants: int = 0,
        state: State | None = None,
        t_end: float = 0.0,
    ) -> Trial:
        """A run with a number of steps.

        Parameters
        ----------
        method : Method
        steps : int
        allowed : float, optional
            Fraction of the stability limit below which the step must be; inf for any step.
        instants : int, optional
            At which states are stored, a divisor of `steps`.
        state : State, optional
            Another initial state.
        t_end : float, optional
            Another duration [s].

        Returns
        -------
        Trial

        Raises
        ------
        ContactError, LockingError, StabilityError
            It failed.
        KeyboardInterrupt
            It was interrupted.
        """
        problem = self._problem(method, state, t_end)
        began = time.process_time()
        found = march(problem, steps, allowed, instants)
        seconds = time.process_time() - began
        if not found.complete:
            raise KeyboardInterrupt
        u, v = found.state()[:2]
        return Trial(u.copy(), v.copy(), steps, steps * evaluations(method), seconds, found)

    def steps(self, method: Method, fraction: float, least: int = 1) -> int:
        """Number of steps for a fraction of the method's natural step, at what the reference met
        or, before there is one, at what the energy admits.

        Parameters
        ----------
        method : Method
        fraction : float
        least : int, optional

        Returns
        -------
        int
        """
        omega = self.fastest or self.bounds.expected.frequency
        return steps_at(self._problem(method), fraction, omega, least)

    def gap(self, u: Array, v: Array, true: Reference | Trial) -> float:
        """Difference from a last state.

        Parameters
        ----------
        u, v : ndarray
        true : Reference or Trial

        Returns
        -------
        float
            Relative to the scales; inf where it is not finite.
        """
        parts = np.max(np.abs(u - true.u)), np.max(np.abs(v - true.v))
        error = max(float(x / s) if s else float(x) for x, s in zip(parts, self.scale, strict=True))
        return error if math.isfinite(error) else math.inf

    def refusal(self, method: Method) -> str:
        """Why a method does not take the scene, or an empty text."""
        try:
            self.run(method, 1, math.inf, t_end=TINY * self.t_end)
        except FAILED:
            return ""
        except TensegrityError as error:
            return str(error)
        return ""


def evaluations(method: Method) -> int:
    """Evaluations of all forces in a step."""
    return method.stages if method.explicit else NEWTON


def applicable(trials: Trials, methods: Any) -> tuple[list[Method], dict[str, str]]:
    """Methods to compare, and those left out with the reason.

    Parameters
    ----------
    trials : Trials
    methods : sequence of str or Method, or None

    Raises
    ------
    TensegrityError
        Not a method, or none that takes the scene.
    """
    opens, left = not trials.dynamics.is_driven and trials.dynamics.opens, {}
    if methods is None:
        chosen: list[Method] = [*METHODS.values(), RK8]
    else:
        chosen = [find(one) for one in check.sequence("methods", methods, "methods")]
    taken = []
    for method in chosen:
        words = trials.refusal(method)
        if methods is None and isinstance(method, Corrected) and not opens:
            words = f"no contact can open: its steps are those of {method.base.name}"
        if methods is None and not method.explicit:
            words = f"implicit, compared where it is named: {method.limitations.split(';')[0]}"
        if words:
            left[method.name] = words
        else:
            taken.append(method)
    if not taken:
        raise TensegrityError("no method: " + "; ".join(f"{k}: {x}" for k, x in left.items()))
    return taken, left


def reference(trials: Trials, given: Any, share: float) -> Reference:
    """The reference of a scene, and the scales of its errors.

    Parameters
    ----------
    trials : Trials
        Receives scales, frequency and samples.
    given : State, callable (t) -> State, "long double", or None
        What the user calls true; by default own runs.
    share : float
        Of the time allowed, after which it is refined no more.

    Returns
    -------
    Reference

    Raises
    ------
    ContactError, LockingError, StabilityError
        No step leads to the end.
    TensegrityError
        Not a state, or no long double for this scene.
    """
    fine, other = _methods(trials)
    best: Reference | None = None
    failed: Exception | None = None
    worse = 0
    for one, two in _pairs(trials, fine, other):
        if isinstance(one, Exception):
            failed = one
            continue
        previous, error = best, trials.gap(two.u, two.v, one)
        if best is None or error <= best.error:
            words = f"{fine.name}, {one.steps} steps, against {other.name}, {two.steps}"
            best = Reference(one.u, one.v, error, words)
        if error < EXACT or trials.used() > share or given is not None:
            break
        worse += previous is not None and error > previous.error / 2
        if worse > 1:
            break  # round-off
    if best is None:
        raise failed or AssertionError
    if given is None:
        return best
    if isinstance(given, str):
        return long_double(trials, given)
    true = given(trials.t_end) if callable(given) else given
    check.kind("reference", true, State)
    u, v = (
        check.vector(f"{x} of the reference", getattr(true, x), trials.scene.shape) for x in "uv"
    )
    return Reference(u, v, 0.0, "given")


def _methods(trials: Trials) -> tuple[Method, Method]:
    """The best method for a scene, and another one that shows its error."""
    of = trials.dynamics
    fine = find(default(None, 1e-12, not of.is_driven and of.opens, of.needs_rates))
    if isinstance(fine, Corrected):
        return fine, Corrected("suzuki6", 6, base=suzuki(6), default_fraction=0.1)
    rivals = [] if of.opens else [one for one in (RK8, METHODS["rk4"]) if one is not fine]
    return fine, next((one for one in rivals if not trials.refusal(one)), suzuki(6))


def _pairs(trials: Trials, fine: Method, other: Method) -> Iterator[tuple[Any, Any]]:
    """Runs of two methods, finer and finer; or the error by which one failed."""
    size = max(trials.state.u.size, 1)
    instants = max(1, min(INSTANTS, ENTRIES // size))
    for level in range(MOST_LEVELS):
        fraction = FIRST / 2**level
        least = trials.steps(fine, fraction, FEWEST)
        steps = instants * math.ceil(least / instants)
        try:
            one = trials.run(fine, steps, instants=instants)
            trials.fastest, trials.samples = one.march.fastest, one.march.samples
            largest = np.abs(one.march.samples).reshape(2, -1).max(axis=1)
            trials.scale = np.maximum(largest, 0.0)
            yield one, trials.run(other, trials.steps(other, fraction, FEWEST))
        except FAILED as error:
            yield error, None


def long_double(trials: Trials, given: str) -> Reference:
    """The same loop compiled with long double, with small steps; its error is that which the
    difference from a run with half as many implies.

    Parameters
    ----------
    trials : Trials
    given : str
        "long double".

    Returns
    -------
    Reference

    Raises
    ------
    TensegrityError
        Another text, a scene that is not a chain of smooth springs alone, or a processor whose long
        double is double.
    """
    of, method = trials.dynamics, METHODS["rkn6"]
    if given != "long double":
        raise TensegrityError(f"reference {given!r} must be 'long double', or a State")
    plain = isinstance(trials.scene, Chain) and of.smooth and not of.is_driven
    if not plain or np.finfo(np.longdouble).eps == np.finfo(float).eps:
        raise TensegrityError(
            "reference 'long double' is for chains of smooth springs that are neither driven nor "
            "damped, on processors that have it"
        )
    engine = Compiled.of(of.loop_bonds, extended=True)
    steps, ends = 2 * trials.steps(method, EXTENDED), []
    for count in (steps, steps // 2):
        u, v = (x.astype(engine.dtype) for x in (trials.state.u, trials.state.v))
        bind(u, v, of.loop_bonds, method, trials.t_end / count, engine).advance(count)
        ends.append(Reference(u, v, 0.0, f"{method.name} in long double, {steps} steps"))
    error = trials.gap(ends[1].u, ends[1].v, ends[0]) / (2**method.order - 1)
    return ends[0]._replace(error=max(error, float(np.finfo(np.longdouble).eps)))


Closed = State | Callable[[float], State] | str
