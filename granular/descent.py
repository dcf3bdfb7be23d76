"""The largest force on a wall behind a chain of beads, and its slopes by their diameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
