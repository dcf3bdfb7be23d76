"""Exact gradients of a run by the discrete adjoint of the splitting methods.

Derivatives of the computed result with respect to all initial values, masses and parameters are
obtained together at the cost of a few runs: from the last state every stage is inverted, and the
transpose of its derivative is applied there.  Only a few states are stored, with which the reverse
pass is compared.  Source: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical
Integration (2006), V.1 (symmetric methods); J. M. Sanz-Serna, SIAM Rev. 58, 3 (2016).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated, Any, overload

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine import methods, native, threaded
from tensegrity.engine.codegen import depends_on
from tensegrity.engine.driven import bind as bind_driven
from tensegrity.engine.reverse import Layout, OutputCotangents
from tensegrity.errors import TensegrityError
from tensegrity.gradients import result
from tensegrity.gradients.adjoint import Backward, Forward
from tensegrity.gradients.forced import ForcedBackward, check_forced, parameters_of
from tensegrity.gradients.objective import Objective, Trace, objective_of
from tensegrity.gradients.result import Gradient, digits
from tensegrity.gradients.samples import TraceSamples
from tensegrity.notebook import one_bar
from tensegrity.readonly import fixed
from tensegrity.runs.problem import Problem, step_count
from tensegrity.runs.record import Record
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array, Count, Duration

ROWS = 4  # rows of the returned run after the first; each interrupts the loop
ALWAYS = ("u", "v", "mass")  # arguments by which every gradient is computed
STATES = 8  # stored states of a run, evenly spaced


@dataclass(frozen=True)
class _Task:
    """The checked arguments of `gradient` except the scene and its state."""

    objectives: tuple[Objective, ...]
    t_end: float
    dt: float
    method: methods.Splitting
    wanted: Sequence[str] | None
    checkpoints: int | None


@overload
def gradient(
    objective: Trace | Objective,
    scene: Scene | Ensemble,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = ...,
    dt: float,
    wanted: Sequence[str] | None = ...,
    checkpoints: int | None = ...,
) -> Gradient: ...
@overload
def gradient(
    objective: Sequence[Trace | Objective],
    scene: Scene | Ensemble,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = ...,
    dt: float,
    wanted: Sequence[str] | None = ...,
    checkpoints: int | None = ...,
) -> list[Gradient]: ...
@checked
def gradient(
    objective: Trace | Objective | Sequence[Trace | Objective],
    scene: Scene | Ensemble,
    state: State,
    t_end: Annotated[float, ">= 0", "s"],
    *,
    method: str | methods.Method | None = None,
    dt: Duration,
    wanted: Sequence[str] | None = None,
    checkpoints: Count | None = None,
) -> Any:
    """Compute objectives of a run and their derivatives with respect to all it depends on.

    Parameters
    ----------
    objective : Trace, Objective, or a sequence of them
        See `tensegrity.objective`; a bare trace stands for its value at the end.  Several
        objectives are evaluated in the same run and reverse pass.
    scene : Scene
        A `Chain`, a `Network` of fixed contacts, an `Ensemble`, or what `granular` builds.
    state : State
        Initial displacements [m] and velocities [m/s]; not changed.
    t_end : float
        Duration [s], >= 0.
    method : str or Method, optional
        A splitting: "verlet", the default with a fixed step as in `simulate`; "rkn6", or one of
        your own.  With drives, dashpots or further forces "rk4", the default, or "rk8".
    dt : float
        Step [s], as for `simulate`.  A gradient is that of one run with one step: find the step
        that a tolerance needs with `simulate(..., tol=)` first.
    wanted : sequence of str, optional
        Names for `Gradient.by`, fewer cost less; by default all but the exponent of Hertz's law.
    checkpoints : int, optional
        Largest number of steps between two states of the run that the reverse pass starts from.
        By default states are added only where it deviates from the run by more than 1e-9.  Chains
        of beads that touch without overlap at the start require about 10 for more than 5 correct
        digits of the derivatives with respect to their initial state; `reversal` does not show
        this.

    Returns
    -------
    Gradient, or list of Gradient
        One for each objective.  For an ensemble, the last axis of all arrays counts its scenes.

    Raises
    ------
    TensegrityError
        A method whose stages cannot be inverted; springs without derivatives (polynomials,
        elastic members, power laws of exponent below 1); bonds or sites that do not exist; the load
        of a bond in which a force acts; an arrival that never occurs; and the errors of `simulate`.

    Examples
    --------
    The peak load of the last contact of five beads, of which the first strikes at 1 m/s.

    >>> from tensegrity import Chain, PowerLaw, gradient, objective
    >>> chain = Chain(PowerLaw(stiffness=1.0, exponent=1.5), sites=5)
    >>> peak = objective.peak(objective.load(bond=3))
    >>> found = gradient(peak, chain, chain.at_rest({0: 1.0}), 6.0, dt=0.01)
    >>> print(round(found.value, 4), found.v.round(3), found.by("stiffness").round(3))
    0.6393 [ 0.767 -0.064 -0.516 -1.038  0.851] [0.02  0.034 0.069 0.133]
    """
    many = isinstance(objective, Sequence) and not isinstance(objective, str)
    objectives = tuple(map(objective_of, objective if many else (objective,)))  # type: ignore
    if not objectives:
        raise TensegrityError("objective is an empty sequence: nothing to differentiate")
    if not isinstance(scene, HasDynamics):
        raise TensegrityError(f"scene {check.shown(scene)} is not a scene, such as a Chain")
    scene.check(state)
    for one in objectives:
        if one.latest > t_end * (1 + 1e-12):
            raise TensegrityError(f"{one!r} needs {one.latest:g} s, the run ends at {t_end:g} s")
    native.require()
    task = _Task(objectives, t_end, dt, _stepping(scene, method, dt), wanted, checkpoints)
    with one_bar("step"):
        results = (_of_batch if isinstance(scene, Ensemble) else _of_scene)(task, scene, state)
    return results if many else results[0]


def traces_of(
    traces: tuple[Trace, ...], scene: Any, state: State, t_end: float, method: Any, dt: float
) -> tuple[Array, Array]:
    """Traces of the run that `gradient` does.

    Parameters
    ----------
    traces, scene, state, t_end, method, dt
        As of `gradient`.

    Returns
    -------
    t, y : ndarray, (steps + 1,), (traces, steps + 1)
    """
    scene.check(state)
    task = _Task((), t_end, dt, _stepping(scene, method, dt), (), None)
    _, _, forced, layout = _prepared(task, scene, traces)
    samples = TraceSamples(scene, layout, traces)
    _, forward, t = _sampled(task, scene, state, samples, forced, (0, _steps(task)[0]))
    return t, samples.values(forward.rows, forward.closing)


def _stepping(scene: Any, method: Any, dt: float) -> Any:
    """The method, once it is found to have gradients of the scene."""
    driven = dynamics(scene).is_driven
    method = methods.default(dt, None, False, driven) if method is None else method
    return _with_rates(method) if driven else _splitting(method)


def _splitting(method: str | methods.Method) -> methods.Splitting:
    splitting: Any = methods.find(method)
    if type(splitting) is not methods.Splitting:
        reason = "its stages cannot be inverted one by one"
        if isinstance(splitting, (methods.Splitting, methods.Corrected)):
            reason = "it has more than kicks and drifts, whose adjoint alone is derived here"
        raise TensegrityError(
            f"method {splitting.name!r} has no gradient, because {reason}: take verlet or rkn6"
        )
    return splitting


def _with_rates(method: str | methods.Method) -> Any:
    nystrom: Any = methods.find(method)
    if not getattr(nystrom, "rates", ()):
        raise TensegrityError(
            f"method {nystrom.name!r} has no gradient of a scene with drives, dashpots or further "
            "forces: take rk4 or rk8"
        )
    return nystrom


def _of_batch(task: _Task, scene: Any, state: Any) -> Any:
    """Gradients of all scenes of an ensemble, on threads, as the loops release the interpreter."""

    def one(number: int) -> Any:
        return _of_scene(task, scene.scenes[number], scene.select(state, number))

    first = one(0)  # compiles the loops for all
    with ThreadPoolExecutor(threaded.threads()) as pool:
        each = [first, *pool.map(one, range(1, scene.count))]
    return [_stacked(scenes) for scenes in zip(*each, strict=True)]


def _stacked(gradients: Sequence[Gradient]) -> BatchGradient:
    def batch_last(each: Sequence[Any]) -> Any:
        if isinstance(each[0], dict):
            return fixed({name: batch_last([x[name] for x in each]) for name in each[0]})
        return np.stack(each, axis=-1)

    names = ("value", "u", "v", "mass", "parameters", "shift")
    return BatchGradient(
        **{name: batch_last([getattr(one, name) for one in gradients]) for name in names},
        run=tuple(one.run for one in gradients),  # type: ignore[arg-type]
        reversal=max(one.reversal for one in gradients),
        digits=min(one.digits for one in gradients),
        _scene=tuple(gradients),
        _names=gradients[0]._names,
    )


class BatchGradient(Gradient):
    """The gradient of an ensemble: `value` (scenes,), one `run` for each scene; the last axis of
    all arrays counts scenes."""

    def by(self, name: str) -> Array:
        """Derivatives as by `Gradient.by`, with a last axis that counts scenes."""
        return np.stack([one.by(name) for one in self._scene], axis=-1)


def _of_scene(task: _Task, scene: Any, state: Any) -> list[Gradient]:
    """Gradients for one scene: its run, the traces, and the reverse pass."""
    of = dynamics(scene)
    if of.follows:
        raise TensegrityError(
            "contacts that are detected during a run have no gradient: list those that act, with "
            "contacts='fixed'"
        )
    for spring in of.springs.different:
        result.refuse(spring)
    traces = tuple(dict.fromkeys(trace for one in task.objectives for trace in one.traces))
    names, of_forces, forced, layout = _prepared(task, scene, traces)
    steps, dt = _steps(task)
    samples = TraceSamples(scene, layout, traces)
    windows = [_window(one, steps, dt) for one in task.objectives]
    first, last = min(w[0] for w in windows), max(w[1] for w in windows)
    check.memory(
        f"traces of {steps} steps at {len(samples.places)} places",
        8.0 * (last - first + 1) * (len(samples.places) * (1 + len(windows)) + len(traces)),
    )
    run, forward, t = _sampled(task, scene, state, samples, forced, (first, last))
    sampled = forward.rows, forward.closing
    values, slopes = _valued(task, traces, t, samples.values(*sampled), windows, first)
    each = [samples.pullback(one, *sampled) for one in slopes]
    by_rows, p, g, m, w = map(np.array, zip(*each, strict=True))
    if forced:
        forced.withdraw(by_rows)
    cotangents = OutputCotangents(by_rows, samples.places, samples.u_count, first)
    back = forced or Backward(layout, task.method, dt, len(windows))
    more = (len(windows),) if forced else (forward.recompute, task.checkpoints)
    back.go(forward.states, cotangents, *more)
    p += back.totals.p
    g += back.totals.g
    w += back.totals.w.reshape(*w.shape, -1).sum(axis=-1)
    u, v = (x.reshape(len(x), *scene.shape).copy() for x in (back.u, back.v))
    heavy = layout.bonds.coupling is not None  # the sums are by masses, else by their inverses
    mass = m - (w if heavy else w * of.inverse_mass**2)
    for array in (u, v, mass):
        array[:, list(scene.held)] = 0
    return [
        Gradient(
            value, run, fixed(u[k]), fixed(v[k]), fixed(mass[k]),
            _by_name(layout, p[k], forced.named(k) if forced else {}, of_forces, back.totals, k),
            fixed(g[k]), back.reversal, digits(value, u[k], v[k], back.largest), scene, names,
        )
        for k, value in enumerate(values)
    ]  # fmt: skip


def _sampled(
    task: _Task, scene: Any, state: Any, samples: Any, forced: Any, window: tuple[int, int]
) -> tuple[Any, Forward, Array]:
    """The run, its samples at the steps of a window, and the instants of these."""
    (steps, dt), every = _steps(task), task.checkpoints
    states = STATES if every is None else max(STATES, math.isqrt(steps // every + 1))
    record = Record(every=max(1, -(-steps // ROWS)))
    bind = bind_driven if forced else None  # without the corrections at the onset of contacts
    problem = Problem(scene, state, task.t_end, task.method, record, bind=bind)
    stride = max(1, -(-steps // states))
    stride = min(stride, forced.stride if forced else stride)
    forward = Forward(problem, steps, samples, window, stride)
    run = forward.run()
    if not run.complete:
        raise KeyboardInterrupt
    t = dt * np.arange(window[0], window[1] + 1, dtype=float)
    if forced:
        forced.complete(samples, t, forward.rows)
    return run, forward, t


def _valued(
    task: _Task, traces: Any, t: Array, y: Array, windows: Any, first: int
) -> tuple[list[float], list[Array]]:
    """The objectives of traces y at times t, from step `first` on, and their derivatives."""
    values, each = [], []
    for one, (start, stop) in zip(task.objectives, windows, strict=True):
        inside, mine = slice(start - first, stop - first + 1), list(map(traces.index, one.traces))
        value, slope = one.rule(t[inside], y[mine, inside])
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            raise TensegrityError(f"{one!r} is {value} with derivatives that are not finite")
        slopes = np.zeros(y.shape)
        np.add.at(slopes[:, inside], mine, slope)
        values.append(float(value))
        each.append(slopes)
    return values, each


def _steps(task: _Task) -> tuple[int, float]:
    """Number of steps, and the step [s]."""
    steps = step_count(task, task.dt)
    return steps, task.t_end / steps if steps else task.dt


def _prepared(task: _Task, scene: Any, traces: Any) -> tuple[Any, Any, Any, Layout]:
    """The names for `Gradient.by`, the parameters of forces, the reverse pass of a driven scene or
    None, and the layout."""
    of = dynamics(scene)
    stored = any(trace.kind == "energy" for trace in traces)
    if scene.bond_mass is not None:
        _refuse_heavy(of, traces)
    if not of.is_driven:
        names, numbers = _requested(scene, task.wanted, stored, {})
        return names, {}, None, Layout(of.loop_bonds, numbers)
    check_forced(scene, traces)
    of_forces = parameters_of(scene)
    names, numbers = _requested(scene, task.wanted, stored, of_forces)
    forced = ForcedBackward(scene, numbers, task.method, *_steps(task))
    return names, of_forces, forced, forced.layout


def _refuse_heavy(of: Any, traces: Any) -> None:
    """Refuse what has no gradient with bonds with mass."""
    if of.is_driven:
        raise TensegrityError(
            "bonds with mass have no gradient beside drives, dashpots or further forces"
        )
    for trace in traces:
        if trace.kind in ("velocity", "energy"):
            raise TensegrityError(
                f"{trace.kind} of sites on bonds with mass has no gradient: take displacements or "
                "loads"
            )


def _requested(
    scene: Any, wanted: Any, stored: bool, of_forces: Any
) -> tuple[tuple[str, ...], tuple[tuple[int, ...], ...]]:
    """The names for `Gradient.by`, and for each law the indices of the parameters they change.

    Only parameters on which the tension depends count, unless the `stored` energy is an objective.
    """
    table = dynamics(scene).springs
    laws, law, parameters = table.table
    of_springs = {name: None for spring in table.different for name in result.names(spring)}
    of_beads = dict.fromkeys(dynamics(scene).arguments)
    known = of_springs | of_beads | dict.fromkeys(of_forces)
    if scene.bond_mass is not None:
        known["bond_mass"] = None
    names = result.usual(known, laws) if wanted is None else _checked(wanted, known, laws)
    moved = {*names, *(("stiffness", "preload") if of_beads.keys() & names else ())}
    slopes = [result.slopes(table, name) for name in moved & of_springs.keys()]
    depends = np.any(slopes, axis=0) if slopes else np.zeros(parameters.shape, dtype=bool)
    symbols, requested = {*names} - of_springs.keys(), []
    for number, one in enumerate(laws):
        mine = set(np.flatnonzero(depends[law == number].any(axis=0)).tolist())
        mine |= {k for k, s in enumerate(one.parameters) if str(s) in symbols}
        requested.append(tuple(sorted(mine if stored else mine & depends_on(one))))
    return names, tuple(requested)


def _checked(wanted: Any, known: Any, laws: Any) -> tuple[str, ...]:
    """The requested names, if the scene has them all."""
    if isinstance(wanted, str) or not isinstance(wanted, (Sequence, set, frozenset)):
        raise TensegrityError(f"wanted {check.shown(wanted)} must be a sequence of names")
    symbols = {str(s) for law in laws for s in law.parameters}
    for name in wanted:
        check.kind("name in wanted", name, str)
        if name in ALWAYS:
            raise TensegrityError(
                f"wanted {name!r} names no parameter of the springs: the derivatives by it are "
                f"always computed, as the attribute {name} of the result; leave it out"
            )
        if name not in known and name not in symbols:
            raise TensegrityError(f"wanted {check.shown(name)} is not one of {', '.join(known)}")
    return tuple(dict.fromkeys(wanted))


def _window(one: Objective, steps: int, dt: float) -> tuple[int, int]:
    """First and last step on which an objective depends."""
    if one.over is None:
        return steps, steps
    first = math.ceil(min(one.over[0] / dt * (1 - 1e-12), steps))
    last = math.floor(min(one.over[1] / dt * (1 + 1e-12), steps))
    if last < first:
        over = f"{one.over[0]:g} s and {one.over[1]:g} s"
        raise TensegrityError(f"no step of {dt:g} s ends between {over}")
    return first, last


def _by_name(
    layout: Layout, p: Array, forced: Any, of_forces: Any, totals_of: Any, objective: int
) -> Any:
    """Derivatives by name of a parameter, (bonds,), from those by index in each law and those by
    the parameters of forces, on sites (sites,)."""
    law = layout.bonds.law_of_bond
    totals: dict[str, Array] = {}
    for number, one in enumerate(layout.bonds.laws):
        for row, place in enumerate(layout.wanted[number]):
            column = totals.setdefault(str(one.parameters[place]), np.zeros(len(law)))
            column[law == number] = p[row, law == number]
    for name in of_forces:
        totals[name] = totals[name] + forced[name] if name in totals else forced[name]
    if layout.bonds.coupling is not None:
        totals["bond_mass"] = totals_of.bond_mass[objective]
    return fixed(totals)
