"""Time integration of a scene: `simulate` checks what it is given and chooses the step; `resume`
goes on with what was killed, interrupted or failed, from the state kept beside its rows."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, overload

from tensegrity import check
from tensegrity.engine import methods, native
from tensegrity.errors import TensegrityError
from tensegrity.runs import archive
from tensegrity.runs.march import Start
from tensegrity.runs.motion import Point
from tensegrity.runs.problem import AprioriBounds, Problem
from tensegrity.runs.record import Record, beside, watching
from tensegrity.runs.run import Run, unchecked, unchecked_replace
from tensegrity.runs.step import default_step, fixed_step, resumed
from tensegrity.runs.tolerance import ROUND_OFF, to_tolerance
from tensegrity.scenes.dynamics import HasDynamics, dynamics

if TYPE_CHECKING:
    from pathlib import Path

    from tensegrity.runs.record import Observe
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
    a_priori = AprioriBounds(of, state, energy)
    problem = unchecked(
        Problem,
        scene=scene,
        state=state,
        t_end=t_end,
        method=method,
        record=record,
        observe=tuple(watching(observe, record, scene, t_end)),
        choice=choice,
        a_priori=a_priori,
        given=dt,
    )
    if dt is not None:
        run = fixed_step(problem, dt)
    elif tol is not None:
        run = to_tolerance(problem, tol)
    else:
        run = default_step(problem)
    return unchecked_replace(run, wall_time=time.perf_counter() - started)


def resume(path: str | os.PathLike[str], scene: Scene | Ensemble | None = None) -> Run:
    """Go on with a run that was recorded with a checkpoint, to the end that it had.

    Rows and bits are those of an unbroken run with the same step.  Rows written after the last
    checkpoint are computed again.  Of a run with a `tol` the trial is finished that was under
    way: its step stays, `error_estimate` is None.

    Parameters
    ----------
    path : str or path
        The file of its rows; that of the state lies beside it.
    scene : optional
        The same scene, where it is made of an energy of the user's own, which no file holds.

    Returns
    -------
    Run
        Of the whole time; a run that had ended is returned as it is.  `wall_time` is that of
        this part.

    Raises
    ------
    TensegrityError
        No state beside the rows; damaged files; a scene that is needed and not given, or is
        another one.
    CompilerError, StabilityError, LockingError, ContactError, RecordError
        As `simulate`.
    """
    started = time.perf_counter()
    path = check.path("path", path)
    whole = archive.read(beside(path), "state", lambda data: Broken(**data))
    scene = _same(whole.scene, scene, path)
    try:
        start = whole.start(scene)
    except TensegrityError as error:
        raise TensegrityError(f"{beside(path)} holds no state, or is damaged: {error}") from error
    problem = Problem(
        scene, whole.state, whole.t_end, methods.find(whole.method),
        replace(whole.record, path=path), choice=whole.choice,
    )  # fmt: skip
    native.require()
    run = resumed(problem, whole.steps, whole.allowed, start)
    return replace(run, wall_time=time.perf_counter() - started)


class Broken(NamedTuple):
    """What the file of a run that was broken off holds."""

    scene: Any
    state: Any
    t_end: Any
    method: Any
    record: Any
    choice: Any
    steps: Any
    allowed: Any
    done: Any
    u: Any
    v: Any
    seen: Any
    count: Any
    elongation_range: Any

    def start(self, scene: Any) -> Start:
        """Where the run goes on, if all parts fit each other and the scene."""
        check.kind("scene", scene, HasDynamics)
        of = dynamics(scene)
        of.checked(self.state)
        check.number("t_end", self.t_end, least=0, unit="s")
        methods.find(self.method)
        check.kind("record", self.record, Record)
        if not isinstance(self.choice, str) or self.choice not in ("dt", "tol", "default"):
            raise TensegrityError(f"choice {check.shown(self.choice)} of a step is not known")
        check.whole("steps", self.steps, least=0)
        check.number("allowed", self.allowed, above=0)
        check.whole("done", self.done, least=0, below=self.steps + 1)
        check.whole("count", self.count, least=0)
        shape = of.arrays(self.state)[0].shape
        count, springs = (4, len(of.springs)) if of.is_driven else (2, None)
        if len(check.sequence("seen", self.seen, "arrays")) != count:
            raise TensegrityError(f"seen has {len(self.seen)} arrays, must have {count}")
        for x in (self.u, self.v, *self.seen[:2]):
            archive.array("u or v", x, shape)
        if of.is_driven:
            archive.array("work and loss", self.seen[2], (2, *of.batch))
            work = archive.array("sums", self.seen[3], (4, *of.batch), are_finite=False)[:2]
            check.finite("sums", work)  # behind them elongations, inf at first
        archive.array("elongation_range", self.elongation_range, (springs, 2))
        seen, sums = (self.seen[:3], self.seen[3]) if of.is_driven else (self.seen, None)
        return Start(
            Point(self.done, self.u, self.v, seen, self.elongation_range, sums), self.count
        )


def _same(kept: Any, given: Any, path: Path) -> Any:
    """The scene of a file, or one that was handed in, if it is the same."""
    if given is None and isinstance(kept, archive.Printed):
        raise TensegrityError(
            f"the scene of {path} cannot be built from a file: give it as `scene`; it printed "
            f"{kept}"
        )
    if given is None:
        return kept
    saved = kept.fingerprint if isinstance(kept, archive.Printed) else archive.fingerprint(kept)
    if archive.fingerprint(given) != saved:
        raise TensegrityError(
            f"scene {check.shown(given)} is not that of {path}, which printed {kept!r}: sites, "
            "masses, springs, drives or their numbers differ"
        )
    return given
