"""From the call to the answer: `simulate(tol=...)` against the best bare fixed step, and others.

Seven scenes; what is timed is the whole call, rows and energies as by default.  Its true error is
the largest over the run, of u over max|u| and of v over max|v|, against steps far smaller (in
extended precision where the scene is smooth).  The best bare fixed step is the cheapest prepared
loop, of any method and with the exact force, whose error over the run stays within the tolerance:
what somebody who knew the answer could do.  heyoka and DOP853 with a compiled right-hand side
give 500 rows and their energies too; what they compile is not counted, as ours is not.
Times are CPU time of one pinned processor, minima of repeats, all in turn.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks import _against, _peers
from benchmarks._timing import record, table
from benchmarks.methods import EXTENDED, omega, scenes
from benchmarks.work_precision import all_scenes
from tensegrity import METHODS, Chain, PowerLaw, Prism, Record, State, TensegrityError, simulate
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.precision.peers import TAYLOR, heyoka_system, numba_side
from tensegrity.precision.peers import TOLERANCES as DOP
from tensegrity.runs.step import first_factor
from tensegrity.scenes.dynamics import dynamics

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
INSTANTS = 32  # at which errors are taken
FINER = 1.12  # ratio of the numbers of steps of two bare runs
REFERENCE = 300.0  # evaluations of the forces per unit of 1/omega
KINKS = 400.0  # times that where contacts open
ROUNDS, LONG = 5, 0.5  # calls that take longer than so many seconds are timed once
ROWS = 500
BARE = ("verlet", "rkn6")
MOST_BARE = 4.0  # seconds of one bare run
GOALS = {1e-3: 6.0, 1e-9: 3.0}
CALLS, ROW_COUNTS, ROW_SITES = 300, (200, 4200), (16, 256)


@dataclass(frozen=True)
class Case:
    """A scene to be run; `tension` is its force law for peers."""

    run: tuple
    tension: tuple | None = None
    kinks: bool = False
    tolerances: tuple = TOLERANCES


def cases():
    """{name: Case}."""
    known, _ = all_scenes()
    prism = Prism(1.0, 0.7, 0.01, 1.0)
    textbook = _peers.prism_tension(prism)
    soft = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05)
    held = Chain(soft, 200, ends=("fixed", "free"))
    ten = Chain(prism.potential(), 10)
    rough = {"kinks": True, "tolerances": TOLERANCES[:-1]}
    return {
        "wave, 128 prisms": Case(scenes()["wave"], textbook),
        "near locking, 128": Case(known["locking"], textbook),
        "200 soft elastic prisms": Case((held, held.at_rest({1: 0.15}), 60.0)),
        "10 prisms": Case((ten, ten.at_rest({0: 0.03}), 60.0), textbook),
        "60 Hertz beads, struck": Case(known["contacts"], **rough),
        "half Y-guide, 300 us": Case(known["Y-guide"], **rough),
        "100 tapered beads": Case(tapered(100), **rough),
    }


def tapered(sites):
    """Beads that shrink by half along the chain, the first one moving, in their own units."""
    radius = np.linspace(1.0, 0.5, sites)
    springs = [PowerLaw(math.sqrt(a * b / (a + b)), 1.5) for a, b in itertools.pairwise(radius)]
    chain = Chain(springs, sites, radius**3)
    return chain, chain.at_rest({0: 0.1}), 1.2 * sites


def looks(scene, state, method, t_end, steps, engine=None):
    """u and v at `INSTANTS` + 1 instants of a bare run; (instants, ...) each."""
    u, v = dynamics(scene).arrays(state)
    if engine is not None:
        u, v = u.astype(engine.dtype), v.astype(engine.dtype)
    dt, found = t_end / steps, [(u.copy(), v.copy())]
    if engine is None:
        loop = dynamics(scene).bind(u, v, method, dt)
    else:
        loop = bind(u, v, dynamics(scene).loop_bonds, method, dt, engine)
    for _ in range(INSTANTS):
        loop.advance(steps // INSTANTS)
        found.append((u.copy(), v.copy()))
    return tuple(np.stack(x)[:, : scene.sites] for x in zip(*found, strict=True))


def gap(found, exact):
    """Largest difference in u or v over the run, over the largest value in it."""
    parts = [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(found, exact, strict=True)]
    return float(max(parts)) if np.isfinite(parts).all() else math.inf


def whole(steps):
    """A number of steps that the instants divide."""
    return INSTANTS * math.ceil(steps / INSTANTS)


def reference(case):
    """u and v at the instants, and an estimate of their error."""
    scene, state, t_end = case.run
    smooth = isinstance(scene, Chain) and not case.kinks
    engine = Compiled.of(dynamics(scene).loop_bonds, extended=EXTENDED) if smooth else None
    steps = REFERENCE * t_end * omega(*case.run) / METHODS["rkn6"].stages
    steps = whole(steps * (KINKS if case.kinks else 1))
    fine, coarse = (
        looks(scene, state, METHODS["rkn6"], t_end, n, engine) for n in (steps, whole(steps / 2))
    )
    return fine, gap(coarse, fine) / (4 if case.kinks else 63)


def clock(call):
    """CPU seconds of a call, and what it returns."""
    began = time.process_time()
    found = call()
    return time.process_time() - began, found


def least(call):
    """Least CPU seconds of several calls."""
    best = clock(call)[0]
    for _ in range(ROUNDS if best < LONG else 0):
        best = min(best, clock(call)[0])
    return best


def bare(case, exact):
    """Rows (steps, error, seconds, method) of prepared loops, steps growing."""
    scene, state, t_end = case.run
    scale, rows = t_end * omega(*case.run), []
    for name in BARE:
        method = METHODS[name]
        steps, reached = 1.05 * scale / method.stability_limit, math.inf
        while True:
            n = whole(steps)
            try:
                error = gap(looks(scene, state, method, t_end, n), exact)
            except TensegrityError:
                error = math.inf
            seconds = None
            if error < reached:
                seconds = _bare_seconds(case, method, n)
                rows.append((n, error, seconds, name))
                reached = error
            if reached < case.tolerances[-1] or n > 1e6:
                break
            if seconds is not None and seconds > (0.05 if name == "verlet" else MOST_BARE):
                break
            steps *= FINER if reached < 10 * case.tolerances[0] else 1.05
    return rows


def _bare_seconds(case, method, steps):
    scene, state, t_end = case.run
    dt, best = t_end / steps, math.inf
    for _ in range(3):
        loop = dynamics(scene).bind(*dynamics(scene).arrays(state), method, dt)
        loop.forget()
        best = min(best, clock(partial(loop.advance, steps))[0])
    return best


def cheapest(rows, tol):
    """(seconds, method) of the cheapest bare run within a tolerance."""
    good = [(seconds, name) for _, error, seconds, name in rows if error <= tol]
    return min(good, default=(math.nan, "-"))


def peers(case, exact):
    """Rows (name, error, seconds) of heyoka and DOP853, with rows and energies."""
    if case.tension is None:
        return
    scene, state, t_end = case.run
    n, start = scene.sites, np.concatenate([state.u, state.v])
    grid = np.linspace(0, t_end, ROWS)
    at = np.linspace(0, t_end, INSTANTS + 1)

    def energies(rows):
        return scene.site_energy(State(rows[:, :n], rows[:, n:])).sum(axis=-1)

    if _peers.has("heyoka"):
        import heyoka as hy

        system = heyoka_system(scene, case.tension)
        for tol in TAYLOR:
            solver = hy.taylor_adaptive(system, start.copy(), tol=tol, compact_mode=True)

            def taylor(times, solver=solver):
                solver.time, solver.state[:] = 0.0, start
                rows = solver.propagate_grid(times)[-1]
                energies(rows)
                return rows

            found = taylor(at)
            yield "heyoka", gap((found[:, :n], found[:, n:]), exact), least(lambda: taylor(grid))
    if _peers.has("numba"):
        from scipy.integrate import solve_ivp

        side = numba_side(case.tension, dynamics(scene).inverse_mass)
        size = float(np.abs(start).max())
        for tol in DOP:

            def dop(times, tol=tol):
                options = {"method": "DOP853", "rtol": tol, "atol": tol * size}
                rows = solve_ivp(side, (0.0, t_end), start, t_eval=times, **options).y.T
                energies(np.ascontiguousarray(rows))
                return rows

            found = dop(at)
            yield "DOP853", gap((found[:, :n], found[:, n:]), exact), least(lambda: dop(grid))


def at_error(rows, name, level):
    """Seconds of a peer for an error, between two of its runs along a power law."""
    points = sorted((seconds, error) for who, error, seconds in rows if who == name)
    for k, (seconds, error) in enumerate(points):
        if error <= level:
            if k == 0 or points[k - 1][1] <= error:
                return seconds
            before, above = points[k - 1]
            share = math.log(above / level) / math.log(above / max(error, 1e-18))
            return before * (seconds / before) ** share
    return math.nan


def answers(name, case):
    """Print a scene's table; the rows (tol, ratio, times of peers over ours)."""
    scene, state, t_end = case.run
    exact, known = reference(case)
    fixed, others = bare(case, exact), list(peers(case, exact))
    at, lines, found = np.linspace(0, t_end, INSTANTS + 1), [], []
    for tol in case.tolerances:
        call = _call(case, tol)
        seconds, run = clock(call)
        if seconds < LONG:
            seconds = min(seconds, least(call))
        there = simulate(scene, state, t_end, tol=tol, record=Record(times=at.tolist()))
        error = gap((there.u, there.v), exact)
        best, method = cheapest(fixed, tol)
        rivals = [at_error(others, who, max(error, 1e-14)) for who in ("heyoka", "DOP853")]
        lines.append(
            (f"{tol:.0e}", 1e3 * seconds, error, run.error_estimate or 0.0, run.steps, run.method,
             1e3 * best, method, seconds / best, *(_ratio(x / seconds) for x in rivals))
        )  # fmt: skip
        found.append((tol, seconds / best, *rivals))
    heads = ["tol", "call [ms]", "true error", "estimate", "steps", "method", "bare [ms]", "by",
             "call/bare", "heyoka/call", "DOP853/call"]  # fmt: skip
    table(f"{name} ({scene.sites} sites), reference good to {known:.0e}", heads, lines,
          ["call/bare"], ["heyoka/call", "DOP853/call"])  # fmt: skip
    return found


def _ratio(x):
    return x if np.isfinite(x) else "-"


def _call(case, tol):
    return lambda: simulate(*case.run, tol=tol)


def fixed_cost():
    """Seconds of a call of hardly any work: the least of many, each from another state; and
    of the steps alone that it does."""
    chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 10)
    states = [chain.at_rest({0: 0.02 + 1e-5 * k}) for k in range(CALLS)]
    few, trials = Record(every=10**6), 1 + 1 / first_factor(1e-3, False)
    calls = {
        "dt=, 2 steps": ({"dt": 0.5, "record": few}, 1),
        "default step": ({"record": few}, 1),
        "tol=1e-3": ({"tol": 1e-3, "record": few}, trials),
    }
    found = {}
    for name, (given, runs) in calls.items():
        call = min(
            clock(lambda s=s, given=given: simulate(chain, s, 1.0, **given))[0] for s in states
        )
        run = simulate(chain, states[0], 1.0, **given)
        loop = dynamics(chain).bind(*dynamics(chain).arrays(states[0]), METHODS[run.method], run.dt)
        steps = round(runs * run.steps)
        found[name] = call, min(clock(partial(loop.advance, steps))[0] for _ in range(CALLS))
    return found


def row_cost():
    """{sites: seconds of a recorded row}, from runs that differ in their rows only."""
    found = {}
    for sites in ROW_SITES:
        chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), sites)
        state, steps = chain.at_rest({0: 0.02}), ROW_COUNTS[1]
        given = {"dt": 0.05, "t_end": 0.05 * steps}
        few, many = (
            least(partial(simulate, chain, state, record=Record(every=every), **given))
            for every in (steps // ROW_COUNTS[0], 1)
        )
        found[sites] = (many - few) / (steps - ROW_COUNTS[0])
    return found


def main(names=None, against=None):
    """Print call, error, bare step and peers of every scene; then what a call and a row cost; or
    only what calls cost, beside those of a commit."""
    if against is not None:
        calls = _against.against(against)
        rows = [(name, *both, both[0] / both[1]) for name, both in calls.items()]
        table(f"calls [us], against {against}", ["", "here", "there", "ratio"], rows, ["ratio"])
        return
    if hasattr(os, "sched_setaffinity"):
        kept = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {max(kept)})
    try:
        _main(names)
    finally:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, kept)


def _main(names):
    goals = []
    for name, case in cases().items():
        if names and not any(x in name for x in names):
            continue
        for tol, ratio, *_ in answers(name, case):
            if tol in GOALS:
                wanted = 5.0 if "locking" in name and tol < 1e-8 else GOALS[tol]
                goals.append((f"{name}, {tol:.0e}", f"<= {wanted:g}", ratio))
    table("call over the best bare fixed step", ["", "target", "measured"], goals)
    calls = [
        (name, "<= 60", 1e6 * call, 1e6 * steps, 1e6 * (call - steps))
        for name, (call, steps) in fixed_cost().items()
    ]
    heads = ["", "target", "call", "its steps", "beside them"]
    table("fixed cost of a call [us]", heads, calls)
    for name, _, call, steps, _ in calls:
        record("fixed cost of a call", name, "call over its steps", call, steps)
    rows = [(f"{n} sites", f"<= {2 + 0.005 * n:.3g}", 1e6 * s) for n, s in row_cost().items()]
    table("a recorded row [us]", ["", "target", "measured"], rows)
