"""Time integration of a scene: `simulate` checks what it is given and chooses the step."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, overload

from tensegrity import check
from tensegrity.engine import methods, native
from tensegrity.errors import TensegrityError
from tensegrity.runs.observers import watching
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Record
from tensegrity.runs.run import changed, known
from tensegrity.runs.step import default_step, fixed_step
from tensegrity.runs.stepping import Outlook
from tensegrity.runs.tolerance import ROUND_OFF, to_tolerance
from tensegrity.scenes.dynamics import HasDynamics, dynamics

if TYPE_CHECKING:
    from tensegrity.runs.observers import Observe
    from tensegrity.runs.run import Run, RunBatch
    from tensegrity.scenes.ensemble import Ensemble
    from tensegrity.scenes.scene import Scene, State


@overload
def simulate(
    scene: Scene,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = ...,
    dt: float | None = ...,
    tol: float | None = ...,
    record: Record | None = ...,
    observe: Observe | None = ...,
) -> Run: ...
@overload
def simulate(
    scene: Ensemble,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = ...,
    dt: float | None = ...,
    tol: float | None = ...,
    record: Record | None = ...,
    observe: Observe | None = ...,
) -> RunBatch: ...
def simulate(
    scene: Scene | Ensemble,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = None,
    dt: float | None = None,
    tol: float | None = None,
    record: Record | None = None,
    observe: Observe | None = None,
) -> Run:
    """Advance a scene in time.

    Parameters
    ----------
    scene : Scene or Ensemble
        A `Chain`, a `Network`, an `Ensemble`, or what `granular` builds.
    state : State
        Initial displacements [m] and velocities [m/s]; not changed.
    t_end : float
        Duration [s], >= 0.
    method : str or Method, optional
        Name of a method, `tensegrity.engine.methods.METHODS`, or a `Splitting` or `Nystrom` of
        `tensegrity.engine.methods` with rows of your own.  By default "rkn6"; "verlet" where `dt`
        is given; else "corrected6" where contacts can open, of exponents from 1 to 3, or a force
        has such corners, unless a `tol` is 1e-3 or looser.
    dt : float, optional
        Step [s]; the step used is the largest not above it that divides `t_end` evenly.  By
        default a small fraction of the stability limit, at the largest stiffness that any
        bond can meet with the initial energy, or does meet; so small that the energy is kept to
        1e-8 where contacts open, of exponents from 1 to 3.
    tol : float, optional
        Wanted bound of max(|du|/max|u|, |dv|/max|v|), maxima over the run, instead of `dt`: the
        step is refined until runs with different steps, compared all along, say it is met.
        Refused where a spring's force jumps at an elongation that is met: steps have an error of
        first order there, whatever the method.
    record : Record, optional
    observe : callable, (callable, Record), or a sequence of these, optional
        f(t, u, v) is called once at each instant that `record` keeps, in order, or at those of a
        Record of its own (`every`, `times` or `interval`), with read-only copies of u [m] and v
        [m/s] of all sites.  What it returns ends the run there if it is true.  An exception in it
        ends the run too, with a warning, and as by Ctrl-C what was recorded is returned.  No
        observer changes a bit of the run.  Without `dt` the step is found first, and f is called
        in one more run, which is the one that is returned.

    Returns
    -------
    Run
        Of an `Ensemble` a `RunBatch`.  Also after Ctrl-C, with `complete` False and what was
        recorded until then; with `tol` that may be a trial with a coarser step, kept in memory and
        at about 500 instants.  `stopped` says which observer ended it, and when.

    Raises
    ------
    TensegrityError
        Bad input, before any work.
    CompilerError
        No C compiler, before any work.
    StabilityError
        `dt` is beyond the method's stability limit; during a run with `.run`, the part done.
    LockingError
        A spring reached an end of its domain; with `.run`, the part done.
    RecordError
        A row or a state could not be written; with `.run`, the part done.
    """
    started = time.perf_counter()
    if not isinstance(scene, HasDynamics):
        raise TensegrityError(f"scene {scene!r} is not a scene, such as a Chain")
    of = dynamics(scene)
    energy = of.checked(state)
    t_end = check.number("t_end", t_end, least=0, unit="s")
    dt = None if dt is None else check.number("dt", dt, above=0, unit="s")
    tol = None if tol is None else check.number("tol", tol, least=ROUND_OFF)
    if dt is not None and tol is not None:
        raise TensegrityError(f"dt {dt!r} s and tol {tol!r} exclude each other: give one")
    if method is None:
        method = methods.default(dt, tol, not of.is_driven and of.opens)
    method = methods.find(method)
    record = Record() if record is None else record
    check.kind("record", record, Record)
    record.check(scene.sites, t_end)
    native.require()
    choice = "dt" if dt is not None else "default" if tol is None else "tol"
    outlook = Outlook(of, state, energy)
    problem = known(
        Problem,
        scene=scene,
        state=state,
        t_end=t_end,
        method=method,
        record=record,
        observe=tuple(watching(observe, record, scene, t_end)),
        choice=choice,
        outlook=outlook,
        given=dt,
    )
    if dt is not None:
        run = fixed_step(problem, dt)
    elif tol is not None:
        run = to_tolerance(problem, tol)
    else:
        run = default_step(problem)
    return changed(run, wall_time=time.perf_counter() - started)
