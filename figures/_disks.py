"""Beads drawn as disks."""

import numpy as np


def disks(axes, places, diameter, **style):
    """Draw beads; returns the collection that takes the colours.

    Parameters
    ----------
    axes : Axes
        In millimetres.
    places : array_like, (beads, 2)
        [m]
    diameter : float
        [m]
    **style
        Of an `EllipseCollection`.
    """
    from matplotlib.collections import EllipseCollection

    size = np.full(len(places), 1e3 * diameter)
    found = EllipseCollection(
        size, size, 0 * size, units="xy", offsets=1e3 * np.asarray(places),
        offset_transform=axes.transData, **style,
    )  # fmt: skip
    axes.add_collection(found)
    axes.set(aspect="equal", xlabel="x [mm]")
    axes.grid(False)
    return found
