"""Pictures of a run; Matplotlib is imported here and not before."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes

FAINTEST = 1e-4  # of the largest energy density: the lower end of the colours


def energy_density(run: Any, axes: Axes | None = None) -> Axes:
    """Energy of each site against time, logarithmic colours; returns the axes."""
    from matplotlib.colors import LogNorm

    scene = run.scene
    if run.sites != tuple(range(scene.sites)):
        raise TensegrityError(
            f"{len(run.sites)} of {scene.sites} sites recorded: record all to plot"
        )
    axes = check.axes(axes)
    density = scene.site_energy(run.u, run.v)
    largest = density.max() or 1.0
    image = axes.pcolormesh(
        np.arange(scene.sites),
        run.t,
        np.clip(density, FAINTEST * largest, None),
        norm=LogNorm(FAINTEST * largest, largest),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    axes.set(xlabel="site", ylabel="time [s]")
    axes.figure.colorbar(image, ax=axes, label="energy per site [J]")
    return axes
