"""Runs that were killed, interrupted or failed, from the state kept beside their rows."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.runs import archive
from tensegrity.runs.book import Sound, Start
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import beside
from tensegrity.runs.run import Run
from tensegrity.runs.step import resumed

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

    from tensegrity.scenes.scene import Scene


def resume(path: str | os.PathLike[str], scene: Scene | None = None) -> Run:
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
    StabilityError, LockingError, ContactError, RecordError
        As `simulate`.
    """
    started = time.perf_counter()
    path = check.path("path", path)
    data = archive.read(beside(path), "state")
    scene = _same(data["scene"], scene, path)
    problem = Problem(
        scene, data["state"], data["t_end"], data["method"], replace(data["record"], path=path),
        choice=data["choice"],
    )  # fmt: skip
    scene.check(problem.state)
    sound = Sound(data["u"], data["v"], data["done"], data["seen"])
    start = Start(sound, data["count"], data["met"])
    run = resumed(problem, data["steps"], data["allowed"], start)
    return replace(run, wall_time=time.perf_counter() - started)


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
