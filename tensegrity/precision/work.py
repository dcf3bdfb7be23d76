"""Error against cost: `work_precision` runs a scene by all methods that take it.

Each method does a ladder of steps, the largest first that `simulate` accepts, each smaller than the
one before by `FINER`.  The cheapest run of all comes next, whichever method's, so that where time
ends all have done what costs as much.  A method stops at the errors wanted, at round-off, or where
it costs `DOMINATED` times as much as another one.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from tensegrity.checked import checked
from tensegrity.engine import native
from tensegrity.engine.methods import Method
from tensegrity.errors import TensegrityError
from tensegrity.notebook import one_bar, progress
from tensegrity.precision.peers import Peer, runs_of
from tensegrity.precision.result import CALL, WorkPrecision, WorkRow
from tensegrity.precision.stability import drifts, limits
from tensegrity.precision.trials import (
    FAILED,
    Closed,
    Reference,
    Trials,
    applicable,
    evaluations,
    reference,
)
from tensegrity.runs.integrate import simulate
from tensegrity.runs.march import COUNTED
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.scene import State, unchecked_state

FINER = 2 ** (1 / 6)  # ratio of the numbers of steps of two runs of a ladder
WANTED = 1e-12  # error below which nothing is sought
FINEST = 1e4  # cost of the last run of a ladder over that of the first, at most
DOMINATED = 12.0  # cost over that of another method for the same error, where a ladder ends
ROUND_OFF, STAGNANT = 1e-9, 4  # errors below the first that fall no more in so many runs
TOLERANCES = 10.0 ** -np.arange(2, 12)
ROUNDS = 3  # times that each run is repeated at most
# Parts of the time allowed after which each stage ends.
REFERENCE, LADDER, CALLS, PEERS, STABILITY, ENERGY = 0.3, 0.55, 0.65, 0.75, 0.9, 0.95


@checked
def work_precision(
    scene: Any,
    state: State,
    t_end: Annotated[float, "> 0", "s"],
    methods: Sequence[str | Method] | None = None,
    peers: Sequence[str | Peer] = (),
    *,
    reference: Closed | None = None,
    seconds: Annotated[float, "> 0", "s"] = 30.0,
) -> WorkPrecision:
    """Error against cost of a scene, by all methods and steps that it may be run with.

    Parameters
    ----------
    scene, state, t_end
        As of `simulate`.
    methods : sequence of str or Method, optional
        By default those of `METHODS`, and "rk8", that take the scene, but for implicit ones.
    peers : sequence of str or Peer, optional
        Other programs, where they are installed: "dop853", SciPy's, on any scene that is not
        driven; "numba", velocity Verlet, "heyoka", Taylor's method, and "jax", velocity Verlet, on
        chains; a `Peer` is a program of your own.
    reference : State, callable (t) -> State, or "long double", optional
        The true last state, such as a closed form, whose error counts as 0; or our loop in long
        double.  By default the finest run of the best method, and the error of that its difference
        from runs of another method.
    seconds : float, optional
        CPU time after which no run begins [s], that of compilers apart; the result has what was
        done, as after Ctrl-C.

    Returns
    -------
    WorkPrecision

    Raises
    ------
    TensegrityError
        Invalid input, before any work; no method takes the scene.
    ContactError, LockingError, StabilityError
        The scene cannot be run to its end.
    CompilerError
        No C compiler.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, work_precision
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 10)
    >>> found = work_precision(chain, chain.at_rest({0: 0.02}), 20.0)
    >>> best = found.best(1e-6)
    >>> best.method, best.error < 1e-6
    ('rkn6', True)
    """
    if not isinstance(scene, HasDynamics):
        raise TensegrityError(f"scene {scene!r} is not a scene, such as a Chain")
    dynamics(scene).checked(state)
    others = list(runs_of(peers))
    native.require()
    trials = Trials(scene, state, t_end, seconds)
    found = WorkPrecision(scene, t_end, ended="interrupted")
    with one_bar("run"), progress(100, "%") as bar:
        try:
            for reached in _stages(trials, found, methods, others, reference):
                found = reached
                bar.update(max(int(100 * min(trials.used(), 1.0)) - bar.n, 0))
        except KeyboardInterrupt:
            return found
    return replace(found, ended="complete" if trials.used() < 1 else f"ended after {seconds:g} s")


def _stages(
    trials: Trials, found: WorkPrecision, methods: Any, peers: list[Peer], given: Any
) -> Iterator[WorkPrecision]:
    """The result as it grows."""
    chosen, left = applicable(trials, methods)
    true = reference(trials, given, REFERENCE)
    found = replace(
        found,
        reference_error=true.error,
        reference=true.words,
        left_out=left,
        final=unchecked_state(true.u, true.v),
        scale=(float(trials.scale[0]), float(trials.scale[1])),
    )
    repeats: dict[WorkRow, Any] = {}
    for stage in (_ladders(trials, chosen, true), _calls(trials, true)):
        for row, again in stage:
            found = replace(found, rows=(*found.rows, row))
            repeats[row] = again
            yield found
    for row, again in _others(trials, peers, true):
        found = replace(found, rows=(*found.rows, row))
        repeats[row] = again
        yield found
    for limit in limits(trials, true, [m for m in chosen if m.explicit], STABILITY):
        found = replace(found, stability=(*found.stability, limit))
        yield found
    for drift in drifts(trials, [m for m in chosen if m.explicit], ENERGY):
        found = replace(found, energy=(*found.energy, drift))
        yield found
    best = {row: row.seconds for row in found.rows}
    for _ in range(ROUNDS - 1):
        for row, again in repeats.items():
            if trials.used() + 2 * best[row] / trials.seconds < 1:
                best[row] = min(best[row], again())
                yield found
    yield replace(found, rows=tuple(replace(x, seconds=best[x]) for x in found.rows))


def _ladders(
    trials: Trials, methods: list[Method], true: Reference
) -> Iterator[tuple[WorkRow, Any]]:
    """Runs with given steps, cheapest first."""
    floor = max(WANTED, true.error)
    queue: list[tuple[int, int, int]] = []
    errors = {method.name: [math.inf] for method in methods}
    for k, method in enumerate(methods):
        steps = trials.steps(method, 1.0)
        heapq.heappush(queue, (steps * evaluations(method), k, steps))
    firsts = {k: cost for cost, k, _ in queue}
    front: list[tuple[float, float]] = []  # costs and errors of all
    while queue and trials.used() < LADDER:
        cost, k, steps = heapq.heappop(queue)
        method = methods[k]
        known = errors[method.name]
        try:
            trial = trials.run(method, steps)
            error = trials.gap(trial.u, trial.v, true)
            dt = trials.t_end / steps
            row = WorkRow(method.name, f"{steps} steps", dt, cost, error, trial.seconds)
            yield row, lambda method=method, steps=steps: trials.run(method, steps).seconds
            known.append(error)
            front.append((cost, error))
        except FAILED:
            pass
        cheapest = min((c for c, e in front if e <= min(known)), default=cost)
        stagnant = len(known) > STAGNANT and min(known[-STAGNANT:]) > min(known[:-STAGNANT]) / 2
        done = known[-1] <= floor or (stagnant and known[-1] < ROUND_OFF)
        if not done and cost <= min(DOMINATED * cheapest, FINEST * firsts[k]):
            steps = max(steps + 1, math.ceil(FINER * steps))
            heapq.heappush(queue, (steps * evaluations(method), k, steps))


def _calls(trials: Trials, true: Reference) -> Iterator[tuple[WorkRow, Any]]:
    """Whole calls with a tolerance: trial runs, rows and energies."""

    def call(tol: float) -> tuple[Any, float, int]:
        counted: list[int] = []
        token, began = COUNTED.set(counted), time.process_time()
        try:
            run = simulate(trials.scene, trials.state, trials.t_end, tol=tol)
        finally:
            COUNTED.reset(token)
        if not run.complete:
            raise KeyboardInterrupt
        return run, time.process_time() - began, sum(counted)

    for tol in TOLERANCES.tolist():
        if trials.used() > CALLS or tol < true.error:
            return
        try:
            run, seconds, count = call(tol)
        except TensegrityError:
            return
        error = trials.gap(run.final.u, run.final.v, true)
        row = WorkRow(CALL, f"tol {tol:g}", math.nan, count, error, seconds)
        yield row, lambda tol=tol: call(tol)[1]


def _others(
    trials: Trials, peers: Iterable[Peer], true: Reference
) -> Iterator[tuple[WorkRow, Any]]:
    """Runs of other programs; the finer ones of one that is slow are left out."""
    for peer in peers:
        for entry in peer.entries(trials.scene, trials.state, trials.t_end):
            if trials.used() > PEERS:
                break

            def run(entry: Any = entry) -> tuple[Any, Any, float]:
                work = entry.prepare()
                began = time.process_time()
                u, v = work()
                return u, v, time.process_time() - began

            u, v, seconds = run()
            error = trials.gap(u, v, true)
            if math.isfinite(error):
                row = WorkRow(
                    peer.name,
                    entry.setting,
                    math.nan,
                    entry.evaluations(),
                    error,
                    seconds,
                    entry.compiled,
                )
                yield row, lambda run=run: run()[2]
