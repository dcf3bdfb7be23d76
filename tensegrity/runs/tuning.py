"""Springs changed while a wave travels: "on the fly".

The springs of a chain depend on time: `spring_at(t)` gives the Potential of all bonds at an
instant, such as prisms whose cross strings are drawn in.  Whoever changes them does work on the
chain at the rate dV/dt at given elongation, summed over the bonds.

The run is that of `tensegrity.runs.march`.  Total energy minus work is what stays constant, and so
checks it.  The parameters of the springs are Chebyshev series in time, fitted to round-off and
compared with `spring_at` between the nodes.  Where an argument of the springs follows an expression
of time, `Chain(..., tune={...})` takes it, `simulate` runs it to a tolerance, and elastic prisms
and preloads may change too.  Source: seeds/000, "adjusted on the fly, through suitable control of
prestress".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import methods, native
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.runs.march import march
from tensegrity.runs.problem import Problem, count
from tensegrity.runs.record import Record
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import Potential
from tensegrity.springs.tuned import NO_END, STAYS, InTime, finite_ends

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tensegrity.engine.methods import Method
    from tensegrity.typing import Array

DEGREES = (32, 64, 128, 256, 512)  # of the series in time
TAIL = 1e-12  # of the largest coefficient, left at the end of a series
DENSER = 4  # instants a coefficient at which a series is compared with the springs
MISFIT = 1e-11  # of the largest coefficient, allowed there
MOST_STEPS = 1e8
FITTED = {  # potentials whose numbers come from a fit, and what to take in their place
    ElasticPotential: ("a prism with elastic bases or bars", "the members as rigid (inf)"),
    Polynomial: ("a polynomial in place of a spring", "the spring itself"),
}


@dataclass(frozen=True, eq=False)
class TunedRun:
    """A run with springs that changed.

    Attributes
    ----------
    t : ndarray, (T,)
        Recorded instants [s].
    u, v : ndarray, (T, sites)
        Displacement [m] and velocity [m/s] of the recorded sites.
    energy, work : ndarray, (T,)
        Total energy, in the springs of that instant, and the work done on the chain by changing
        them [J].  Energies are counted from the unstretched chain at every instant: the work
        that the change takes in a chain at rest is left out.
    final : State
    scene : Chain
        With the springs of the last instant.
    dt : float
        [s]
    sites : tuple of int
    """

    t: Array
    u: Array
    v: Array
    energy: Array
    work: Array
    final: State
    scene: Chain
    dt: float
    sites: tuple[int, ...]

    @property
    def energy_error(self) -> float:
        """Largest deviation of energy - work from its first value, over its size unless 0."""
        deviation = np.abs(self.energy - self.work - self.energy[0]).max()
        return float(deviation / (abs(self.energy[0]) or 1.0))


def simulate_tuned(
    chain: Chain,
    state: State,
    t_end: float,
    spring_at: Callable[[float], Potential],
    *,
    dt: float,
    method: str | Method = "rkn6",
    record: Record | None = None,
) -> TunedRun:
    """Advance a chain whose springs change in time.

    Parameters
    ----------
    chain : Chain
        Masses and ends; its springs must be those of the first instant.
    state : State
    t_end : float
        [s]
    spring_at : callable
        spring_at(t) gives the Potential of all bonds at an instant [s].  All must be of one law
        and one length, so that r = 0 is the same shape at all times (rigid prisms without
        preload keep it; the rest length of others depends on the prestress), and change
        smoothly.  A change that is over within less than about 1/130 of `t_end` can be missed,
        or is refused as too abrupt: run it in parts.  Prisms with elastic bases or bars
        are refused, and so is a `Polynomial`: their numbers are fitted anew at each instant, and
        the round-off of that does not change smoothly.
    dt : float
        Step [s]; the step used is the largest not above it that divides `t_end` evenly.
    method : str or Splitting
        A splitting method.
    record : Record, optional

    Raises
    ------
    TensegrityError
        Bad input, springs of another law or length, elastic prisms, polynomials, more than 1e8
        steps.
    CompilerError
        No C compiler.
    ResolutionError
        The springs change too abruptly.
    StabilityError
        The step is beyond the method's stability limit, or the motion is no longer finite.
    LockingError
        A spring reached an end of its domain; says which and when.
    """
    if not isinstance(chain, Chain):
        raise TensegrityError(f"chain is {type(chain).__name__}, not a Chain")
    if dynamics(chain).is_driven:
        raise TensegrityError("the chain is driven, damped or tuned: `simulate` runs it")
    chain.check(state)
    t_end = check.number("t_end", t_end, above=0, unit="s")
    dt = check.number("dt", dt, above=0, unit="s")
    method = methods.find(method)
    if not isinstance(method, methods.Splitting):
        raise TensegrityError(f"method {method.name!r} is not a splitting of kicks and drifts")
    if t_end / dt > MOST_STEPS:
        raise TensegrityError(
            f"dt {dt:g} s takes {t_end / dt:.3g} steps to {t_end:g} s, must be at most "
            f"{MOST_STEPS:g}"
        )
    record = Record() if record is None else record
    check.kind("record", record, Record)
    record.check(chain.sites)
    record.steps(1)  # refuses what is for `simulate` only
    if not callable(spring_at):
        raise TensegrityError(f"spring_at {spring_at!r} is not a function of time")
    native.require()
    springs = _Springs(chain, spring_at, t_end)
    problem = Problem(chain, state, t_end, method, record, tuning=springs)
    run = march(problem, count(problem, dt)).run()
    last = Chain(spring_at(t_end), chain.sites, chain.mass, chain.ends)
    work = np.zeros(len(run.t)) if run.work is None else run.work
    return TunedRun(run.t, run.u, run.v, run.energy, work, run.final, last, run.dt, run.sites)


class _Springs(InTime):
    """One law whose parameters are Chebyshev series in time."""

    def __init__(self, chain: Chain, spring_at: Callable[[float], Potential], t_end: float) -> None:
        self._at, self._t_end = spring_at, t_end
        first = self.spring(0.0)
        for kind, (name, instead) in FITTED.items():
            if isinstance(first, kind):
                raise TensegrityError(
                    f"spring_at(0) is {name}: its numbers are fitted anew at each instant and "
                    f"carry round-off that no series in time follows; take {instead}"
                )
        if any(s is not first and s != first for s in dynamics(chain).springs.different):
            raise TensegrityError("the springs of the chain differ from spring_at(0)")
        self.law, self._length = first.law, first.length
        self.series = self._fit()
        self._rates: Any = np.polynomial.chebyshev.chebder(self.series)
        self._scale = np.abs(self.series[:, :-2]).sum(axis=0).max(initial=0.0)

    def spring(self, t: float) -> Potential:
        """The spring of an instant."""
        spring = self._at(min(max(t, 0.0), self._t_end))
        if not isinstance(spring, Potential):
            raise TensegrityError(f"spring_at({t:g}) is {spring!r}, not a Potential")
        return spring

    def _fit(self) -> Array:
        """Coefficients (degree + 1, parameters + 2), those of the domain's ends last."""
        from numpy.polynomial import chebyshev

        for degree in DEGREES:
            x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
            values = self._sampled(x)
            series: Any = chebyshev.chebfit(x, values, degree)
            scale = np.maximum(np.abs(series).max(axis=0), 1e-3)
            if np.any(np.abs(series[-4:]).max(axis=0) > TAIL * scale):
                continue
            between = 2 * (np.arange(DENSER * (degree + 1)) + 0.5) / (DENSER * (degree + 1)) - 1
            values = self._sampled(between)
            gap = np.abs(chebyshev.chebval(between, series).T - values).max(axis=0)
            if np.all(gap <= MISFIT * scale):
                stays = np.abs(series[1:]).max(axis=0) <= STAYS * np.abs(series[0])
                series[1:, stays] = 0.0
                return series
        raise ResolutionError(
            f"the springs change too abruptly for a series of degree {DEGREES[-1]} over "
            f"{self._t_end:g} s: make the change smoother or longer, or run it in parts"
        )

    def _sampled(self, x: Array) -> Array:
        """Parameters and domains of the springs at instants x in [-1, 1], (x.size, ...)."""
        springs = []
        for t in (self._t_end * (1 + x) / 2).tolist():
            springs.append(self.spring(t))
            self._compare(springs[-1], t)
        ends = np.clip([s.domain for s in springs], -NO_END, NO_END)
        return np.column_stack([[s.values for s in springs], ends])

    def _compare(self, spring: Potential, t: float) -> None:
        if spring.law != self.law:
            raise TensegrityError(f"spring_at({t:g}) is of another law than spring_at(0)")
        if spring.length != self._length:
            raise TensegrityError(
                f"spring_at({t:g}) has length {spring.length:.12g} m at rest, spring_at(0) "
                f"{self._length:.12g} m: elongations would count from another shape"
            )

    def _values(self, series: Array, t: Array) -> Array:
        x = np.clip(2 * t / self._t_end - 1, -1.0, 1.0)
        return np.polynomial.chebyshev.chebvander(x, len(series) - 1) @ series

    def at(self, t: Array) -> Array:
        """Parameters of the law at instants t [s]; (t.size, parameters)."""
        return self._values(self.series, t)[:, :-2]

    def rates(self, t: Array) -> Array:
        """Their rates [1/s]; none of what does not change to round-off."""
        rates = self._values(self._rates, t)[:, :-2] * (2 / self._t_end)
        rates[:, np.abs(rates).max(axis=0) * self._t_end <= TAIL * self._scale] = 0.0
        return rates

    def domain(self, t: Array) -> Array:
        """Lowest and highest elongation at instants t [m]; (t.size, 2)."""
        return finite_ends(self._values(self.series, t)[:, -2:])
