"""The largest force on a wall of any scene of beads that a function builds from a design."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from granular.beads import Bead
from granular.contact_network import wall_sites
from granular.design.objective import METHOD
from granular.observables import largest, wall_force
from tensegrity import Record, TensegrityError, check, simulate

EVERY = 2  # steps between the values that a spline goes through
Build = Callable[[Sequence[Bead]], tuple[Any, str]]


def wall_peak(build: Build, beads: Sequence[Bead], t_end: float, dt: float) -> tuple[float, float]:
    """Largest force on a wall [N], between the steps too, and when [s].

    As `granular.observables.largest` finds it among values at every `EVERY`-th step.  A largest
    force that is the last one, still rising, is inf: the wave has not arrived.

    Parameters
    ----------
    build : callable
        Of the beads, gives a scene with a striker and the name of one of its walls.
    beads : sequence of Bead
    t_end, dt : float
        [s].
    """
    try:
        scene, name = build(beads)
    except (TypeError, ValueError) as error:
        raise TensegrityError(f"build {check.shown(build)} gives no scene: {error}") from error
    kept = Record(every=EVERY, sites=wall_sites(scene, name))
    run = simulate(scene, scene.start(), t_end, method=METHOD, dt=dt, record=kept)
    time, force = largest(run.t, wall_force(run, name))
    return (force, time) if force > 0 and time < run.t[-1] else (math.inf, t_end)
