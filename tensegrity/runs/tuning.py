"""Springs changed while a wave travels: "on the fly".

The springs of a chain depend on time: `spring_at(t)` gives the Potential of all bonds at an
instant, such as prisms whose cross strings are drawn in.  Whoever changes them does work on the
chain at the rate dV/dt at given elongation, summed over the bonds.

Time is taken as one more coordinate, driven at rate 1: a splitting method then advances it with
its drifts, uses the springs of that instant in each kick, and keeps its order; the work is the
change of time's conjugate momentum, summed with the method's own kicks.  Total energy minus work
is what stays constant, and so checks the run.  The parameters of the springs are Chebyshev
series in time, fitted to round-off and compared with `spring_at` between the nodes; the rate of V
comes from them by automatic differentiation of the law.  Source: seeds/000, "adjusted on the fly,
through suitable control of prestress".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import methods
from tensegrity.engine.kernel import kernel
from tensegrity.errors import ResolutionError, StabilityError, TensegrityError
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.runs.record import Record
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.scene import State
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any

    from tensegrity.engine.codegen import Law
    from tensegrity.engine.methods import Method
    from tensegrity.typing import Array

DEGREES = (32, 64, 128, 256, 512)  # of the series in time
TAIL = 1e-12  # of the largest coefficient, left at the end of a series
DENSER = 4  # instants a coefficient at which a series is compared with the springs
MISFIT = 1e-11  # of the largest coefficient, allowed there
MOST_STEPS = 1e8  # of a loop in Python: hours
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
    ResolutionError
        The springs change too abruptly.
    StabilityError
        The step is beyond the method's stability limit, or the motion is no longer finite.
    LockingError
        A spring reached an end of its domain; says which and when.
    """
    if not isinstance(chain, Chain):
        raise TensegrityError(f"chain is {type(chain).__name__}, not a Chain")
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
    if not callable(spring_at):
        raise TensegrityError(f"spring_at {spring_at!r} is not a function of time")
    springs = _Springs(chain, spring_at, t_end)
    steps = math.ceil(t_end / dt * (1 - 1e-12))
    dt = t_end / steps
    u, v, work = state.u.copy(), state.v.copy(), 0.0
    recorded = record.steps(steps)
    columns = record.columns(chain.sites)
    sites = tuple(np.arange(chain.sites)[columns].tolist())
    rows, works = record.rows(len(recorded), len(sites)), []
    wanted = set(recorded.tolist())
    for step in range(steps + 1):
        now = step * dt
        springs.watch(now, u, dt, method)
        if step in wanted:
            kinetic = 0.5 * np.sum(chain.mass * v**2)
            energy = kinetic + np.sum(springs.value(0, now, np.diff(u)))
            rows.add(now, energy, u[columns], v[columns])
            works.append(work)
        if step == steps:
            break
        for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
            if kick:
                r = springs.elongation(now, u)
                pull = np.diff(springs.value(1, now, r), prepend=0.0, append=0.0)
                v += kick * dt * chain.inverse_mass * pull
                work += kick * dt * springs.power(now, r)
            u += drift * dt * v
            now += drift * dt
    table = rows.finished()
    last = Chain(spring_at(t_end), chain.sites, chain.mass, chain.ends)
    return TunedRun(
        table["t"], table["u"], table["v"], table["energy"], np.array(works), State(u, v), last,
        dt, sites,
    )  # fmt: skip


@dataclass(frozen=True)
class Change:
    """Rate of a law's energy in time, at given elongation, as a law of its own.

    Attributes
    ----------
    law : Law
        Its parameters, and then their rates, are those of the change.
    """

    law: Law
    split = False
    compiled = ("energy",)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Those of the law, and their rates."""
        return tuple(f"{kind}{k}" for kind in "pq" for k in range(len(self.law.parameters)))

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The change in CasADi, by automatic differentiation; see `codegen.Law.forms`."""
        import casadi as ca

        r, p, forms = self.law.forms()
        rates = ca.SX.sym("rates", p.numel())
        changes = [ca.jtimes(form, p, rates) for form in forms]
        return r, ca.vertcat(p, rates), changes


class _Springs:
    """One law whose parameters are Chebyshev series in time."""

    def __init__(self, chain: Chain, spring_at: Callable[[float], Potential], t_end: float) -> None:
        self._at, self._t_end = spring_at, t_end
        w = chain.inverse_mass
        self._inverse_masses = 2 * (w[1:] + w[:-1]).max()
        first = self.at(0.0)
        for kind, (name, instead) in FITTED.items():
            if isinstance(first, kind):
                raise TensegrityError(
                    f"spring_at(0) is {name}: its numbers are fitted anew at each instant and "
                    f"carry round-off that no series in time follows; take {instead}"
                )
        if any(s is not first and s != first for s in chain.spring_table.different):
            raise TensegrityError("the springs of the chain differ from spring_at(0)")
        self.law, self._length = first.law, first.length
        self._engine, self._change = kernel((self.law,)), kernel((Change(self.law),))
        self._series = self._fit()
        self._rates: Any = np.polynomial.chebyshev.chebder(self._series)
        self._scale = np.abs(self._series).sum(axis=0).max(initial=0.0)

    def at(self, t: float) -> Potential:
        spring = self._at(t)
        if not isinstance(spring, Potential):
            raise TensegrityError(f"spring_at({t:g}) is {spring!r}, not a Potential")
        return spring

    def _fit(self) -> Array:
        """Coefficients (degree + 1, parameters) and, on the way, the domain common to all times."""
        from numpy.polynomial import chebyshev

        for degree in DEGREES:
            x = np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
            values, domains = self._sampled(x)
            series: Any = chebyshev.chebfit(x, values, degree)
            scale = np.maximum(np.abs(series).max(axis=0), 1e-3)
            if np.any(np.abs(series[-4:]).max(axis=0) > TAIL * scale):
                continue
            between = 2 * (np.arange(DENSER * (degree + 1)) + 0.5) / (DENSER * (degree + 1)) - 1
            values, more = self._sampled(between)
            gap = np.abs(chebyshev.chebval(between, series).T - values).max(axis=0)
            if np.all(gap <= MISFIT * scale):
                domains = np.concatenate([domains, more])
                self._domain = domains[:, 0].max(), domains[:, 1].min()
                return series
        raise ResolutionError(
            f"the springs change too abruptly for a series of degree {DEGREES[-1]} over "
            f"{self._t_end:g} s: make the change smoother or longer, or run it in parts"
        )

    def _sampled(self, x: Array) -> tuple[Array, Array]:
        """Parameters and domains of the springs at instants x in [-1, 1], (x.size, ...)."""
        springs = []
        for t in (self._t_end * (1 + x) / 2).tolist():
            springs.append(self.at(t))
            self._compare(springs[-1], t)
        return np.array([s.values for s in springs]), np.array([s.domain for s in springs])

    def _compare(self, spring: Potential, t: float) -> None:
        if spring.law != self.law:
            raise TensegrityError(f"spring_at({t:g}) is of another law than spring_at(0)")
        if spring.length != self._length:
            raise TensegrityError(
                f"spring_at({t:g}) has length {spring.length:.12g} m at rest, spring_at(0) "
                f"{self._length:.12g} m: elongations would count from another shape"
            )

    def _parameters(self, series: Array, t: float) -> Array:
        x = min(max(2 * t / self._t_end - 1, -1.0), 1.0)
        return np.cos(np.arange(len(series)) * math.acos(x)) @ series

    def value(self, order: int, t: float, r: Array) -> Array:
        """A derivative of V at the instant t."""
        return self._engine.evaluate(0, order, self._parameters(self._series, t), r)

    def power(self, t: float, r: Array) -> float:
        """Sum over the bonds of dV/dt at given elongation [W]."""
        rates = self._parameters(self._rates, t) * (2 / self._t_end)
        if np.abs(rates).max(initial=0.0) * self._t_end <= TAIL * self._scale:
            return 0.0
        numbers = np.concatenate([self._parameters(self._series, t), rates])
        return float(np.sum(self._change.evaluate(0, 0, numbers, r)))

    def elongation(self, t: float, u: Array) -> Array:
        """Elongations at the instant t, refused where a spring has reached an end of its domain."""
        r = np.diff(u)
        if r.min() > self._domain[0] and r.max() < self._domain[1]:
            return r
        if not np.isfinite(r).all():
            raise StabilityError(f"the motion is no longer finite at t = {t:.6g} s: dt too large")
        spring = self.at(min(max(t, 0.0), self._t_end))
        for bond in (int(r.argmin()), int(r.argmax())):
            if not spring.domain[0] < r[bond] < spring.domain[1]:
                error = spring.beyond(float(r[bond]))
                raise type(error)(
                    f"{error}: the spring between sites {bond} and {bond + 1} got there at "
                    f"t = {t:.6g} s"
                )
        return r

    def watch(self, t: float, u: Array, dt: float, method: Method) -> None:
        """Refuse a step beyond the stability limit at the present stiffness."""
        stiffness = self.value(2, t, np.append(self.elongation(t, u), 0.0)).max()
        if not math.isfinite(stiffness):
            raise StabilityError(f"the stiffness is not finite at t = {t:.6g} s")
        omega = math.sqrt(max(stiffness, 0.0) * self._inverse_masses)
        if dt * omega > method.stability_limit:
            raise StabilityError(
                f"dt {dt:.6g} s is beyond {method.stability_limit / omega:.6g} s, the stability "
                f"limit of {method.name} at the stiffness met at t = {t:.6g} s"
            )
