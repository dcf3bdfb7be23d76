"""Time integration of a scene: `simulate` checks its arguments and chooses the step; `resume`
continues a run that was killed, interrupted or failed, from the checkpoint saved with its rows."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, overload

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine import methods, native
from tensegrity.errors import TensegrityError
from tensegrity.runs import archive
from tensegrity.runs.identity import identity
from tensegrity.runs.march import Start
from tensegrity.runs.motion import MotionState
from tensegrity.runs.observers import user_observers
from tensegrity.runs.problem import AprioriBounds, Problem
from tensegrity.runs.record import PLAIN, Record, checkpoint_path
from tensegrity.runs.run import Run, unchecked
from tensegrity.runs.step import default_step, fixed_step, resumed
from tensegrity.runs.tolerance import ROUND_OFF, to_tolerance
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Index, Positive

if TYPE_CHECKING:
    from pathlib import Path

    from tensegrity.runs.observers import Observe
    from tensegrity.runs.run import Run, RunBatch
    from tensegrity.scenes.ensemble import Ensemble
    from tensegrity.scenes.scene import Scene


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
        Name of a method in `tensegrity.METHODS`, or a `Splitting` or `Nystrom` with other
        coefficients.  By default "rkn6"; "verlet" where `dt`
        is given; otherwise "corrected6" where contacts of exponents from 1 to 3 can be lost, or a
        force has a kink of such an exponent, unless `tol` is 1e-3 or looser.
    dt : float, optional
        Step [s]; the step used is the largest not above it that divides `t_end` evenly.  By
        default a small fraction of the stability limit at the largest stiffness that any bond can
        reach with the initial energy, or does reach during the run; small enough to conserve the
        energy to 1e-8 where contacts of exponents from 1 to 3 are lost.
    tol : float, optional
        Bound on the error max(|du|/max|u|, |dv|/max|v|), maxima over the run, instead of `dt`: the
        step is refined until runs with different steps, compared throughout, agree to it; where
        sites are driven or damped, or forces depend on velocity, at every step that they share,
        as transients may be fast.  Pulses in time shorter than 1/4000 of the run may be missed.
        Refused where the force of a spring jumps at an elongation that the run passes: the error
        of fixed steps is of first order there, whatever the method.
    record : Record, optional
    observe : callable, (callable, Record), or a sequence of these, optional
        f(t, u, v) is called once at each instant that `record` names, in order, or at those of a
        Record of its own (`every`, `times` or `interval`), with read-only copies of u [m] and v
        [m/s] of all sites.  A true return value ends the run there.  An exception in f also ends
        the run, with a warning, and, as after Ctrl-C, the rows recorded so far are returned.  No
        observer changes a bit of the run.  Without `dt` the step is chosen first, and f is called
        in one more run, which is the one that is returned.

    Returns
    -------
    Run
        A `RunBatch` for an `Ensemble`.  Also returned after Ctrl-C, with `complete` False and the
        rows recorded until then; with `tol` this may be a trial run with a coarser step, held in
        memory at about 500 instants.  `stopped` says which observer ended the run, and when.

    Raises
    ------
    TensegrityError
        Invalid input, before any work.
    CompilerError
        No C compiler, before any work.
    StabilityError
        `dt` is beyond the method's stability limit; if raised during the run, `.run` is the part
        that was done.
    LockingError
        A spring reached an end of its domain; `.run` is the part that was done.
    RecordError
        A row or a checkpoint could not be written; `.run` is the part that was done.

    Examples
    --------
    The first of five equal beads in contact strikes the others at 1 m/s.

    >>> from tensegrity import Chain, PowerLaw, simulate
    >>> chain = Chain(PowerLaw(stiffness=1.0, exponent=1.5), sites=5)
    >>> run = simulate(chain, chain.at_rest({0: 1.0}), 6.0, tol=1e-8)
    >>> run.method, run.complete, run.error_estimate < 1e-8
    ('corrected6', True, True)
    >>> print(run.final.v.round(3))
    [-0.071 -0.03  -0.014  0.131  0.985]
    """
    started = time.perf_counter()
    if not isinstance(scene, HasDynamics):
        raise TensegrityError(f"scene {scene!r} is not a scene, such as a Chain")
    dyn = dynamics(scene)
    energy = dyn.checked(state)
    t_end = check.number("t_end", t_end, least=0, unit="s")
    dt = None if dt is None else check.number("dt", dt, above=0, unit="s")
    tol = None if tol is None else check.number("tol", tol, least=ROUND_OFF)
    if dt is not None and tol is not None:
        raise TensegrityError(f"dt {dt!r} s and tol {tol!r} exclude each other: give one")
    if method is None:
        method = methods.default(dt, tol, not dyn.is_driven and dyn.opens, dyn.needs_rates)
    method = methods.find(method)
    record = PLAIN if record is None else record
    check.kind("record", record, Record)
    record.check(scene.sites, t_end)
    native.require()
    choice = "dt" if dt is not None else "default" if tol is None else "tol"
    problem = unchecked(
        Problem,
        scene=scene,
        state=state,
        t_end=t_end,
        method=method,
        record=record,
        observe=user_observers(observe, record, scene, t_end),
        choice=choice,
        a_priori=AprioriBounds(dyn, state, energy),
        given=dt,
        dynamics=dyn,
        loop_dynamics=dyn,
    )
    if dt is not None:
        run = fixed_step(problem, dt)
    elif tol is not None:
        run = to_tolerance(problem, tol)
    else:
        run = default_step(problem)
    object.__setattr__(run, "wall_time", time.perf_counter() - started)
    return run


def resume(path: str | os.PathLike[str], scene: Scene | Ensemble | None = None) -> Run:
    """Continue a run that was recorded with a checkpoint, up to its original end.

    The rows agree to the bit with those of an uninterrupted run with the same step.  Rows written
    after the last checkpoint are computed again.  If the run had a `tol`, the trial run in progress
    is completed with its step, and `error_estimate` is None.

    Parameters
    ----------
    path : str or path
        The file of the rows; the checkpoint is the file of the same name with .state.npz added.
    scene : optional
        The same scene, needed where its springs are made of a user's own energy, which no file
        holds.

    Returns
    -------
    Run
        The run over the whole time; a run that had ended is returned unchanged.  `wall_time` is
        the time of this call.

    Raises
    ------
    TensegrityError
        There is no checkpoint, a file is damaged, or the scene is missing or a different one.
    CompilerError, StabilityError, LockingError, ContactError, RecordError
        As `simulate`.

    Examples
    --------
    A run that an observer ends half way is continued to its end.

    >>> import tempfile
    >>> from pathlib import Path
    >>> from tensegrity import Chain, PowerLaw, Record, resume, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=5)
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / "rows.npy"
    >>> record = Record(every=1, path=path, checkpoint=0)
    >>> def half_way(t, u, v):
    ...     return t >= 3.0
    >>> first = simulate(chain, chain.at_rest({0: 1.0}), 6.0, dt=0.1, record=record,
    ...                  observe=half_way)
    >>> print(first.stopped, first.t[-1].round(3))
    half_way ended the run at t = 3 s 3.0
    >>> print(resume(path).t[-1].round(3))
    6.0
    >>> folder.cleanup()
    """
    started = time.perf_counter()
    path = check.path("path", path)
    whole = archive.read(checkpoint_path(path), "state", lambda data: CheckpointData(**data))
    scene = _same_scene(whole.scene, scene, path)
    try:
        start = whole.start(scene)
    except TensegrityError as error:
        raise TensegrityError(
            f"{checkpoint_path(path)} holds no state, or is damaged: {error}"
        ) from error
    problem = Problem(
        scene, whole.state, whole.t_end, methods.find(whole.method),
        replace(whole.record, path=path), choice=whole.choice,
    )  # fmt: skip
    native.require()
    run = resumed(problem, whole.steps, whole.allowed, start)
    return replace(run, wall_time=time.perf_counter() - started)


@checked
@dataclass(frozen=True)
class CheckpointData:
    """The contents of a checkpoint file."""

    scene: Any
    state: State
    t_end: Annotated[float, ">= 0", "s"]
    method: Any
    record: Record
    choice: Annotated[str, ("dt", "tol", "default")]
    steps: Index
    allowed: Positive
    done: Index
    u: Any
    v: Any
    seen: Any
    count: Index
    last_row: Index
    elongation_range: Any

    def start(self, scene: Any) -> Start:
        """The state to continue from, once all parts are consistent with each other and the scene.

        Raises
        ------
        TensegrityError
            An entry has the wrong type, shape or range.
        """
        check.kind("scene", scene, HasDynamics)
        dyn = dynamics(scene)
        dyn.checked(self.state)
        methods.find(self.method)
        check.whole("done", self.done, below=self.steps + 1)
        shape = dyn.arrays(self.state)[0].shape
        springs = len(dyn.springs) if dyn.sums and dyn.law is None else None
        count = 2 + len(dyn.sums)  # states, then work and loss, and the sums of the loop
        if len(check.sequence("seen", self.seen, "arrays")) != count:
            raise TensegrityError(f"seen has {len(self.seen)} arrays, must have {count}")
        for x in (self.u, self.v, *self.seen[:2]):
            archive.array("u or v", x, shape)
        for name, x in zip(("work and loss", "sums"), self.seen[2:], strict=False):
            archive.array(name, x, (2, *dyn.batch))
        seen, sums = self.seen[:3], self.seen[3] if dyn.sums else None
        archive.array("elongation_range", self.elongation_range, (springs, 2))
        return Start(
            MotionState(self.done, self.u, self.v, seen, self.elongation_range, sums),
            self.count,
            self.last_row,
        )


def _same_scene(stored: Any, given: Any, path: Path) -> Any:
    """The scene read from a file, or the one that the user gave, if they are the same."""
    is_printed = isinstance(stored, archive.PrintedScene)
    if given is None and is_printed:
        raise TensegrityError(
            f"the scene of {path} cannot be built from a file: give it as `scene`; it printed "
            f"{stored}"
        )
    if given is None:
        return stored
    digest = stored.fingerprint if is_printed else identity(stored)
    if identity(given) != digest:
        raise TensegrityError(
            f"scene {check.shown(given)} is not that of {path}, which printed {stored!r}: sites, "
            "masses, springs, drives, or numbers or functions in these differ"
        )
    return given
