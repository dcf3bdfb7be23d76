"""Diameters of a chain of beads moved downhill, so that a wall behind it feels least.

The largest force has edges where one maximum in time overtakes another; p-norms of the force have
none, and come nearer to it as p grows.  Sequential quadratic programming (SciPy's SLSQP) goes down
on these in turn, from one start to one basin: give it many starts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular.beads import Bead
from granular.chain import chain
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


NORMS = (8.0, 32.0, 128.0)
PASSES = 120  # of each norm


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
    from scipy.optimize import minimize

    start = check.floats("start", start)
    if not isinstance(between, (tuple, list)) or len(between) != 2:
        raise TensegrityError(f"between {check.shown(between)} must be (least, largest) diameter")
    low, high = (check.number("end of between", x, above=0, unit="m") for x in between)
    length = check.number("length", start.sum() if length is None else length, above=0, unit="m")
    if not low * start.size <= length <= high * start.size:
        raise TensegrityError(
            f"length {length:g} m of {start.size} beads must be from {low * start.size:g} m to "
            f"{high * start.size:g} m"
        )
    passes, best = 0, (np.inf, start)

    def force(x: Array, p: float | None) -> tuple[float, Array]:
        nonlocal passes, best
        passes += 1
        value, slopes = wall_peak(
            x, material=material, striker=striker, wall=wall, t_end=t_end, dt=dt, p=p
        )
        return float(np.log(value)), slopes * high / value

    x = np.clip(start, low, high) / high
    for p in NORMS:
        found = minimize(
            lambda x, p=p: force(x * high, p), x, jac=True, method="SLSQP",
            bounds=[(low / high, 1.0)] * x.size, options={"maxiter": PASSES, "ftol": 1e-6},
            constraints={"type": "eq", "fun": lambda x: x.sum() - length / high,
                         "jac": lambda x: np.ones(x.size)},
        )  # fmt: skip
        x = np.clip(found.x, low / high, 1.0)
        peak = float(np.exp(force(x * high, None)[0]))
        if peak < best[0]:
            best = peak, x * high
    return Descent(best[1], best[0], passes)
