"""Runs that were killed, interrupted or failed, from the state kept beside their rows."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from tensegrity import check
from tensegrity.engine import methods, native
from tensegrity.errors import TensegrityError
from tensegrity.runs import archive
from tensegrity.runs.march import Start
from tensegrity.runs.motion import Point
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Record, beside
from tensegrity.runs.run import Run
from tensegrity.runs.step import resumed
from tensegrity.scenes.dynamics import HasDynamics, dynamics

if TYPE_CHECKING:
    from pathlib import Path

    from tensegrity.scenes.ensemble import Ensemble
    from tensegrity.scenes.scene import Scene


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
    met: Any

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
        archive.array("met", self.met, (springs, 2))
        seen, sums = (self.seen[:3], self.seen[3]) if of.is_driven else (self.seen, None)
        return Start(Point(self.done, self.u, self.v, seen, self.met, sums), self.count)


def _same(kept: Any, given: Any, path: Path) -> Any:
    """The scene of a file, or one that was handed in, if it is the same."""
    if given is None and isinstance(kept, archive.Printed):
        raise TensegrityError(
            f"the scene of {path} cannot be built from a file: give it as `scene`; it printed "
            f"{kept}"
        )
    if given is None:
        return kept
    known = kept.fingerprint if isinstance(kept, archive.Printed) else archive.fingerprint(kept)
    if archive.fingerprint(given) != known:
        raise TensegrityError(
            f"scene {check.shown(given)} is not that of {path}, which printed {kept!r}: sites, "
            "masses, springs, drives or their numbers differ"
        )
    return given
