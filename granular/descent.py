"""The largest force of a struck chain on the wall behind it, and its slopes by the diameters.

One design at a time, by the gradient of a run of the chain itself.  `granular.design.downhill` does
the same for many designs one after the other; from one start to one low place that is `descend`:
give it many starts, or take `granular.design.search` with ``method="gradient"``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular.beads import Bead
from granular.chain import chain
from granular.design.downhill import Pass, downhill
from granular.design.objective import check_blow
from granular.design.spaces import Sizes
from tensegrity import TensegrityError, check, gradient, objective

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from granular.beads import Striker
    from granular.materials import Material
    from tensegrity.typing import Array


def wall_peak(
    diameters: ArrayLike,
    *,
    material: Material,
    striker: Striker,
    wall: Material,
    t_end: float,
    dt: float,
    p: float | None = None,
) -> tuple[float, Array]:
    """Largest force on the wall behind a struck chain, and its derivatives by the diameters.

    Parameters
    ----------
    diameters : array_like, (beads,)
        From the struck end to the wall [m], > 0.
    material, wall : Material
        Of the beads, and of the wall that the last one touches.
    striker : Striker
        In contact with the first bead.
    t_end, dt : float
        Time and step of Verlet's method [s].
    p : float, optional
        The p-norm, divided by that of 1 N all the time, in place of the largest force: smooth, and
        no less than a part of it.

    Returns
    -------
    force : float
        [N].
    slopes : ndarray, (beads,)
        [N/m].
    """
    diameters = check.floats("diameters", diameters)
    if diameters.ndim != 1 or not diameters.size:
        raise TensegrityError(f"diameters of shape {diameters.shape} must be (beads,)")
    scene = chain([Bead(d, material) for d in diameters.tolist()], striker=striker, end=wall)
    load = objective.load(wall=0)
    asked = objective.peak(load) if p is None else objective.p_norm(load, p)
    found = gradient(asked, scene, scene.start(), t_end, dt, wanted=("diameter",))
    scale = 1.0 if p is None else t_end ** (-1 / p)
    return found.value * scale, found.by("diameter")[1:-1] * scale


class Descent(NamedTuple):
    """What a start led to.

    Attributes
    ----------
    diameters : ndarray, (beads,)
        [m].
    force : float
        Largest on the wall [N], with the step given.
    passes : int
        Forces computed, each with its slopes.
    """

    diameters: Array
    force: float
    passes: int


def descend(
    start: ArrayLike,
    *,
    between: tuple[float, float],
    length: float | None = None,
    material: Material,
    striker: Striker,
    wall: Material,
    t_end: float,
    dt: float,
) -> Descent:
    """Diameters downhill from a start, for the least peak force on the wall.

    Parameters
    ----------
    start : array_like, (beads,)
        Diameters [m].
    between : (float, float)
        Least and largest diameter [m].
    length : float, optional
        What they must sum to [m]; by default what the start sums to.
    material, striker, wall, t_end, dt
        As of `wall_peak`.

    Returns
    -------
    Descent
    """
    start = check.floats("start", start)
    if start.ndim != 1:
        raise TensegrityError(f"start of shape {start.shape} must be (beads,)")
    length = check.number("length", start.sum() if length is None else length, above=0, unit="m")
    space = Sizes(start.size, between, length, material)
    check_blow(striker, wall)
    t_end = check.number("t_end", t_end, above=0, unit="s")
    dt = check.number("dt", dt, above=0, unit="s")
    steps = math.ceil(t_end / dt * (1 - 1e-12))  # as of `simulate`
    way = downhill(Pass(space, striker, wall, t_end, steps), space, start)
    if not len(way.forces):
        raise TensegrityError(f"t_end {t_end:g} s is before a wave through the start arrives")
    best = int(np.argmin(way.forces))
    return Descent(way.rows[best], float(way.forces[best]), len(way.forces))
