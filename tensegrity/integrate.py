"""Time integration of a scene: `simulate` checks what it is given and chooses the step."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from tensegrity import check, methods
from tensegrity.errors import TensegrityError
from tensegrity.lattice import Chain
from tensegrity.march import Problem
from tensegrity.record import Record
from tensegrity.run import Run
from tensegrity.tolerance import ROUND_OFF, default_step, fixed_step, to_tolerance

if TYPE_CHECKING:
    from tensegrity.scene import Scene, State


def simulate(
    scene: Scene,
    state: State,
    t_end: float,
    *,
    method: str | methods.Method | None = None,
    dt: float | None = None,
    tol: float | None = None,
    record: Record | None = None,
) -> Run:
    """Advance a scene in time.

    Parameters
    ----------
    scene : Chain
    state : State
        Initial displacements [m] and velocities [m/s]; not changed.
    t_end : float
        Duration [s], >= 0.
    method : str, optional
        Name of a method, `tensegrity.methods.METHODS`.  By default "rkn6"; "verlet" where `dt`
        is given or a `tol` above 1e-3; "processed6" where a smaller `tol` is given and no contact
        of a chain can open.
    dt : float, optional
        Step [s]; the step used is the largest not above it that divides `t_end` evenly.  By
        default a small fraction of the stability limit, at the largest stiffness that any
        bond can meet with the initial energy, or does meet.
    tol : float, optional
        Wanted bound of max(|du|/max|u|, |dv|/max|v|), maxima over the run, instead of `dt`: the
        step is refined until two runs, one with half the step of the other, say it is met.
    record : Record, optional

    Returns
    -------
    Run
        Also after Ctrl-C, with `complete` False and what was recorded until then; with `tol`
        that may be a trial with a coarser step, kept in memory and at about 500 instants.

    Raises
    ------
    TensegrityError
        Bad input, before any work.
    StabilityError
        `dt` is beyond the method's stability limit; during a run with `.run`, the part done.
    LockingError
        A spring reached an end of its domain; with `.run`, the part done.
    """
    started = time.perf_counter()
    if not hasattr(scene, "check"):
        raise TensegrityError(f"scene {scene!r} is not a scene, such as a Chain")
    scene.check(state)
    t_end = check.number("t_end", t_end, least=0, unit="s")
    if dt is not None and tol is not None:
        raise TensegrityError(f"dt {dt!r} s and tol {tol!r} exclude each other: give one")
    method = methods.find(_default(scene, dt, tol) if method is None else method)
    if method.chains_only and not isinstance(scene, Chain):
        raise TensegrityError(f"method {method.name!r} runs a Chain only")
    record = Record() if record is None else record
    if not isinstance(record, Record):
        raise TensegrityError(f"record {record!r} is not a Record")
    record.check(scene.sites)
    problem = Problem(scene, state, t_end, method, record)
    if dt is not None:
        run = fixed_step(problem, check.number("dt", dt, above=0, unit="s"))
    elif tol is not None:
        run = to_tolerance(problem, check.number("tol", tol, least=ROUND_OFF))
    else:
        run = default_step(problem)
    return replace(run, wall_time=time.perf_counter() - started)


def _default(scene, dt, tol):
    smooth = isinstance(scene, Chain) and all(spring.smooth for spring in scene.segment_springs[0])
    return methods.default(dt, tol, smooth)
