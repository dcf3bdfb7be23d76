"""Packs in motion: beads on the left, forces of their contacts on the right, drawn and as a GIF."""

from __future__ import annotations

import numpy as np

from figures._disks import disks

RATE = 10  # frames a second
SHARE = 5.0  # points: width of the line of the largest force


class Stage:
    """One scene in two panels.

    Parameters
    ----------
    panels : two axes
        For the motion and for the forces.
    places : ndarray, (beads, 2)
        As drawn [m].
    diameter : float
        [m]
    box : (left, right, top)
        Of the walls [m].
    factor, most : float
        Of the displacements; the force [N] that has the widest line.
    """

    def __init__(self, panels, places, diameter, box, factor, most):
        from matplotlib.collections import LineCollection

        self._places, self._factor, self._most = 1e3 * places, factor, most
        motion, forces = panels
        for axes in panels:
            left, right, top = (1e3 * x for x in box)
            axes.plot([left, left, right, right], [top, 0, 0, top], "0.3", lw=1.5)
            axes.set(aspect="equal", xlabel="x [mm]")
            axes.set(xlim=(left - 6, right + 6), ylim=(-4, top + 26))
            axes.grid(False)
        motion.set(ylabel="z [mm]")
        self._disks = disks(motion, places, diameter, cmap="viridis", lw=0.3, edgecolors="0.3")
        self._lines = LineCollection([], colors="C3", capstyle="round")
        forces.add_collection(self._lines)

    @property
    def disks(self):
        """What takes the colours of a scale."""
        return self._disks

    def show(self, u, speed, fastest, ends, force):
        """One instant: displacements (beads, 2) [m], speeds, contacts (n, 2, 2) [m] and forces."""
        self._disks.set_offsets(self._places + 1e3 * self._factor * u)
        self._disks.set_array(speed)
        self._disks.set_clim(0, fastest)
        order = np.argsort(force)
        self._lines.set_segments(1e3 * ends[order])
        self._lines.set_linewidths(np.maximum(SHARE * force[order] / self._most, 0.05))


def gif(path, figure, frames, show):
    """Write a GIF of `show(frame)` for each frame of a figure."""
    from PIL import Image

    images = []
    for frame in frames:
        show(frame)
        figure.canvas.draw()
        figure.set_layout_engine("none")  # every frame as the first is laid out
        image = Image.fromarray(np.array(figure.canvas.buffer_rgba())).convert("RGB")
        images.append(image.quantize(128))
    images[0].save(path, save_all=True, append_images=images[1:], duration=1000 // RATE, loop=0)
