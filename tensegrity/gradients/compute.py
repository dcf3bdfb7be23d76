"""Exact gradients of a run: the discrete adjoint of the splitting methods, run backwards.

Derivatives of what was computed, by all initial values, masses and parameters at once, at the
cost of a few runs: from the last state every stage is undone, and the transposed derivative of
the stage is applied where it is undone.  No state is stored, but for a few that the pass is
compared with.  Source: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration
(2006), V.1 (a palindrome of stages is undone by itself); J. M. Sanz-Serna, SIAM Rev. 58, 3 (2016).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import methods, native, pieces
from tensegrity.engine.methods import Splitting
from tensegrity.engine.reverse_layout import Layout
from tensegrity.engine.reverse_text import depends_on
from tensegrity.errors import TensegrityError
from tensegrity.gradients import chained
from tensegrity.gradients.backward import Backward
from tensegrity.gradients.forward import Forward
from tensegrity.gradients.objective import ALWAYS, Objective, Trace, objective_of
from tensegrity.gradients.result import Gradient, digits
from tensegrity.gradients.samples import View
from tensegrity.readonly import fixed
from tensegrity.runs.problem import MOST_STEPS
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.forcing import refuse
from tensegrity.scenes.scene import Scene, State

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.methods import Method
    from tensegrity.typing import Array

STATES = 8  # kept of a run, evenly spaced
MARGIN = 4.0  # of a grid's largest |u| and |v| over those of a run


def gradient(
    objective: Trace | Objective | Sequence[Trace | Objective],
    scene: Scene,
    state: State,
    t_end: float,
    dt: float | None = None,
    method: str | Method = "verlet",
    wanted: Sequence[str] | None = None,
    exact: bool = False,
    checkpoints: int | None = None,
    tol: None = None,
) -> Any:
    """A number that a run gives, and its derivatives by all that the run depends on.

    Parameters
    ----------
    objective : Trace, Objective, or a sequence of them
        See `tensegrity.objective`; a bare trace stands for its value at the end.  Several share
        the run and the pass backwards.
    scene : Scene
        A `Chain`, a `Network` of fixed contacts, an `Ensemble`, or what `granular` builds.
    state : State
    t_end : float
        [s], >= 0.
    dt : float
        Step [s], as for `simulate`.
    method : str or Method, optional
        A splitting: "verlet", "rkn6", or one of your own.
    wanted : sequence of str, optional
        What `by` will be asked for; by default all that it can be.  Fewer cost less.
    exact : bool, optional
        Round every move to a grid of about 1e-16 of the largest displacement and velocity, so
        that the pass backwards returns to the start to the last bit.
    checkpoints : int, optional
        Most steps between two states that the pass backwards is given.  By default it is given
        some more only where it strays from the run by more than 1e-9.  Chains of beads that touch
        without overlap at the start need about 10 where derivatives by their initial state are to
        have more than 5 digits; their `reversal` does not see that.
    tol : None
        Not taken: choose a step with `simulate` first.

    Returns
    -------
    Gradient, or list of Gradient
        One for each objective; of an ensemble with lanes last in all arrays.

    Raises
    ------
    TensegrityError
        A method that cannot be undone step by step, springs without derivatives (polynomials,
        elastic members, power laws of exponent below 1), bonds or sites that are not there, an
        arrival that never comes; what `simulate` raises.
    """
    many = isinstance(objective, Sequence) and not isinstance(objective, str)
    objectives = tuple(map(objective_of, objective if many else (objective,)))  # type: ignore
    if not objectives:
        raise TensegrityError("objective is an empty sequence: nothing to differentiate")
    if not isinstance(scene, HasDynamics):
        raise TensegrityError(f"scene {check.shown(scene)} is not a scene, such as a Chain")
    refuse(scene, "a gradient")
    scene.check(state)
    t_end = check.number("t_end", t_end, least=0, unit="s")
    if tol is not None or dt is None:
        raise TensegrityError(
            f"tol {tol!r}, dt {dt!r}: a gradient is that of one run with one step, choose dt first"
        )
    dt = check.number("dt", dt, above=0, unit="s")
    splitting = _splitting(method)
    exact = check.truth("exact", exact)
    if checkpoints is not None:
        checkpoints = check.whole("checkpoints", checkpoints, least=1)
    for one in objectives:
        if one.latest > t_end * (1 + 1e-12):
            raise TensegrityError(f"{one!r} needs {one.latest:g} s, the run ends at {t_end:g} s")
    native.require()
    if isinstance(scene, Ensemble):
        found = _lanes(objectives, scene, state, (t_end, dt, splitting, wanted, exact, checkpoints))
    else:
        found = _one(objectives, scene, state, t_end, dt, splitting, wanted, exact, checkpoints)
    return found if many else found[0]


def _splitting(method: str | Method) -> Splitting:
    found: Any = methods.find(method)
    if type(found) is not Splitting:
        reason = "its stages are none that can be undone one by one"
        if isinstance(found, (Splitting, methods.Corrected)):
            reason = "it has more than kicks and drifts, whose adjoint alone is derived here"
        raise TensegrityError(
            f"method {found.name!r} has no gradient, because {reason}: take verlet or rkn6"
        )
    return found


def _lanes(objectives: Any, scene: Any, state: Any, rest: Any) -> Any:
    """Those of each scene, on threads: the loops free the interpreter."""
    t_end, dt, *others = rest

    def one(lane: Any) -> Any:
        return _one(objectives, scene.scenes[lane], scene.lane(state, lane), t_end, dt, *others)

    first = one(0)  # compiles what all need
    with ThreadPoolExecutor(pieces.threads()) as pool:
        each = [first, *pool.map(one, range(1, scene.lanes))]
    return [_stacked(scene, [lane[k] for lane in each]) for k in range(len(objectives))]


def _stacked(scene: Any, found: Any) -> Any:
    return LaneGradient(
        value=np.array([x.value for x in found]),  # type: ignore[arg-type]
        run=tuple(x.run for x in found),  # type: ignore[arg-type]
        **{k: np.stack([getattr(x, k) for x in found], axis=-1)
           for k in ("u", "v", "mass", "shift")},
        parameters=fixed({k: np.stack([x.parameters[k] for x in found], axis=-1)
                          for k in found[0].parameters}),
        reversal=max(x.reversal for x in found),
        digits=min(x.digits for x in found),
        _scene=tuple(found),
        _names=found[0]._names,
    )  # fmt: skip


class LaneGradient(Gradient):
    """That of an ensemble: `value` (lanes,), `run` one of each lane, arrays with lanes last."""

    def by(self, name: str) -> Array:
        """As `Gradient.by`, lanes last."""
        return np.stack([lane.by(name) for lane in self._scene], axis=-1)


def _one(
    objectives: Any,
    scene: Any,
    state: Any,
    t_end: Any,
    dt: Any,
    method: Any,
    wanted: Any,
    exact: Any,
    checkpoints: Any,
) -> Any:
    of = dynamics(scene)
    if of.follows:
        raise TensegrityError(
            "contacts that come and go have no gradient here: give the scene those that act, with "
            "contacts='fixed'"
        )
    for spring in of.springs.different:
        chained.refuse(spring)
    traces = tuple(dict.fromkeys(trace for one in objectives for trace in one.traces))
    stored = any(trace.kind == "energy" for trace in traces)
    names, numbers = _wanted(scene, wanted, stored)
    layout = Layout(of.loop_bonds, numbers, exact)
    view = View(scene, layout, traces)
    steps = _steps(t_end, dt)
    dt = t_end / steps if steps else dt
    windows = [_window(one, steps, dt) for one in objectives]
    window = min(w[0] for w in windows), max(w[1] for w in windows)
    check.room(
        f"traces of {steps} steps at {len(view.places)} places",
        8.0
        * (window[1] - window[0] + 1)
        * (len(view.places) * (1 + len(objectives)) + len(traces)),
    )
    states = STATES if checkpoints is None else max(STATES, math.isqrt(steps // checkpoints + 1))
    apart = max(1, -(-steps // states))
    grid = None
    if exact:
        state, grid = _on_grid(scene, state, t_end, dt, method)
    run_of = (scene, state, method, dt, steps, view, window, apart, layout, grid)
    forward = Forward(*run_of)
    run = forward.run(t_end)
    if not run.complete:
        raise KeyboardInterrupt
    t = dt * np.arange(window[0], window[1] + 1)
    read = _Read(view, forward.rows, forward.closing)
    y = np.array([read.value(trace) for trace in traces])
    values, by_rows = [], np.zeros((len(objectives), *forward.rows.shape))
    explicit = []
    for k, (one, part) in enumerate(zip(objectives, windows, strict=True)):
        inside = slice(part[0] - window[0], part[1] - window[0] + 1)
        mine = [traces.index(trace) for trace in one.traces]
        value, slope = one.rule(t[inside], y[mine, inside])
        if not (np.isfinite(value) and np.isfinite(slope).all()):
            raise TensegrityError(f"{one!r} is {value} with derivatives that are not finite")
        values.append(value)
        whole = np.zeros((len(mine), len(t)))
        whole[:, inside] = slope
        by_rows[k], rest = read.back(one.traces, whole)
        explicit.append(rest)
    back = Backward(forward, by_rows, checkpoints)
    largest = tuple(max(float(np.abs(s[k]).max()) for s in forward.states.values()) for k in (0, 1))
    return [
        _gradient(scene, run, layout, names, back, k, values[k], explicit[k], largest)
        for k in range(len(objectives))
    ]


def _wanted(scene: Any, wanted: Any, stored: Any) -> Any:
    """Names that `by` will know, and for each law the numbers of the parameters they move.

    Only of those that the tension depends on, unless the energy is asked for, which has more.
    """
    table = dynamics(scene).springs
    laws, law, parameters = table.table
    known = {name: None for spring in table.different for name in chained.names(spring)}
    beads = dict.fromkeys(dynamics(scene).arguments)
    symbols = {str(s) for one in laws for s in one.parameters}
    if wanted is None:
        names = tuple({**known, **beads})
    else:
        if isinstance(wanted, str) or not isinstance(wanted, (Sequence, set, frozenset)):
            raise TensegrityError(f"wanted {check.shown(wanted)} must be a sequence of names")
        for name in wanted:
            check.kind("name that is wanted", name, str)
        names = tuple(dict.fromkeys(wanted))
        for name in names:
            if name not in known and name not in beads and name not in symbols:
                every = ", ".join({**known, **beads})
                raise TensegrityError(f"wanted {check.shown(name)} is not one of {every}")
    springs = [name for name in names if name in known]
    if any(name in beads for name in names):
        springs += [name for name in ("stiffness", "preload") if name in known]
    found: list[set[int]] = [set() for _ in laws]
    for name in dict.fromkeys(springs):
        each = chained.slopes(table.different, name, parameters.shape[1])
        for number in range(len(laws)):
            found[number] |= set(np.flatnonzero(each[law == number].any(axis=0)).tolist())
    for number, one in enumerate(laws):
        own = [str(s) for s in one.parameters]
        found[number] |= {own.index(name) for name in names if name in own and name not in known}
        if not stored:
            found[number] &= depends_on(one)
    return names, tuple(tuple(sorted(x)) for x in found)


def _steps(t_end: float, dt: float) -> int:
    """How many steps `simulate` does."""
    steps = t_end / dt * (1 - 1e-12)
    if not steps <= MOST_STEPS:
        raise TensegrityError(
            f"t_end {t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than {MOST_STEPS:.0e}"
        )
    return math.ceil(steps)


def _window(one: Any, steps: Any, dt: Any) -> Any:
    """First and last step that an objective looks at."""
    if one.over is None:
        return steps, steps
    if one.over == ALWAYS:
        return 0, steps
    first = min(max(0, math.ceil(one.over[0] / dt * (1 - 1e-12))), steps)
    last = min(math.floor(one.over[1] / dt * (1 + 1e-12)), steps)
    if last < first:
        raise TensegrityError(f"no step of {dt:g} s ends between {one.over[0]:g} s and "
                              f"{one.over[1]:g} s")  # fmt: skip
    return first, last


def _on_grid(scene: Any, state: Any, t_end: Any, dt: Any, method: Any) -> Any:
    """The state rounded to a grid that holds the whole run, and what rounds to it."""
    from tensegrity.runs.integrate import simulate

    run = simulate(scene, state, t_end, method=method, dt=dt)
    grid, rounded = [], []
    for start, kept in ((state.u, run.u), (state.v, run.v)):
        largest = MARGIN * max(float(np.abs(kept).max()), float(np.abs(start).max()), 1e-290)
        big = 1.5 * 2.0 ** math.ceil(math.log2(largest))
        grid.append(big)
        rounded.append((start + big) - big)
    return State(*rounded), tuple(grid)


class _Read:
    """Traces from samples, some steps at once."""

    def __init__(self, view: Any, rows: Any, closing: Any) -> None:
        self._view, self._rows, self._closing = view, rows, closing
        self._parts = [slice(k, k + view.most) for k in range(0, len(rows), view.most)]
        self._kept = self._view.part(rows, closing) if len(self._parts) == 1 else None

    def _part(self, inside: Any, fresh: bool = False) -> Any:
        """Kept where it is one of all steps, with the derivatives begun anew."""
        if fresh or self._kept is None:
            return self._view.part(self._rows[inside], self._closing[inside])
        self._kept.forget()
        return self._kept

    def value(self, trace: Any) -> Any:
        """A trace, (steps,)."""
        return np.concatenate([self._part(inside).value(trace) for inside in self._parts])

    def back(self, traces: Any, slopes: Any) -> Any:
        """Derivatives by the samples, and by parameters, elongations, masses and their inverses.

        Only steps that count are looked at: of a peak there are three.
        """
        rows, rest = np.zeros(self._rows.shape), None
        used = np.flatnonzero(slopes.any(axis=0))
        few = 0 < len(used) < len(rows) / 2
        for inside in self._few(used) if few else self._parts:
            part = self._part(inside, fresh=few)
            for trace, slope in zip(traces, slopes, strict=True):
                if slope[inside].any():
                    part.add(trace, slope[inside])
            rows[inside] = part.rows
            found = part.p.copy(), part.g.copy(), part.m.copy(), part.w.copy()
            rest = found if rest is None else tuple(a + b for a, b in zip(rest, found, strict=True))
        return rows, rest

    def _few(self, used: Any) -> Any:
        """Numbers of steps, as many as are looked at at once; at least one part."""
        return np.array_split(used, max(1, -(-len(used) // self._view.most)))


def _gradient(
    scene: Any,
    run: Any,
    layout: Any,
    names: Any,
    back: Any,
    k: Any,
    value: Any,
    explicit: Any,
    largest: Any,
) -> Any:
    """One objective's result."""
    p, g, m, w = explicit
    order, sites = layout.order, layout.sites
    p[:, order] += back.totals.p[k]
    g[order] += back.totals.g[k]
    by_w = back.totals.w[k, :sites]
    w += by_w if by_w.ndim == 1 else by_w.sum(axis=1)
    mass = m - w * dynamics(scene).inverse_mass ** 2
    u, v = back.u[k].copy(), back.v[k].copy()
    held = list(scene.held)
    u[held], v[held], mass[held] = 0, 0, 0
    law = layout.bonds.law_of_bond
    parameters: dict[str, Array] = {}
    for number, one in enumerate(layout.bonds.laws):
        for row, place in enumerate(layout.wanted[number]):
            column = parameters.setdefault(str(one.parameters[place]), np.zeros(len(law)))
            column[law == number] = p[row, law == number]
    for array in (u, v, mass, g):
        array.flags.writeable = False
    left = digits(value, u, v, largest)
    return Gradient(float(value), run, u, v, mass, fixed(parameters), g, back.reversal, left, scene,
                    names)  # fmt: skip
