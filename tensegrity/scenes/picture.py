"""A network drawn: sites at their positions, walls, and forces as lines of proportional width.

In space it is seen along the second axis, so that the first and the last one span the picture, or
from a direction of choice, the farthest sites first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity import plotting
from tensegrity.scenes.walls import WallArrays
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes

    from tensegrity.scenes.walls import Wall
    from tensegrity.typing import Array

DOT, FULL = 0.12, 0.5  # radius of a site without one, over the shortest bond; where crowded
CROWDED = 2000  # bonds of sites without radius, from which on bonds and forces are not drawn
MARGIN = 0.04  # of the size


def forces(scene: Any, u: Array, factor: float = 1.0) -> tuple[Array, Array]:
    """Ends and tensions of all bonds and wall contacts at given displacements.

    Parameters
    ----------
    scene : Network
    u : ndarray, (sites, dim)
        Displacements [m].
    factor : float, optional
        Magnification of the displacements in the ends.

    Returns
    -------
    ends, tension : ndarray, (n, 2, dim), (n,)
        [m], and [N], extension > 0.
    """
    listed = scene.listed(u)
    x = scene.positions + factor * u
    number, wall = listed.wall_contacts.T
    feet = WallArrays(scene.walls, scene.dim).feet(x[number], wall)
    touching = np.stack([x[number], feet], axis=1)
    tension = np.concatenate([listed.bond_tension(u), -listed.wall_load(u)])
    return np.concatenate([x[listed.bonds], touching]), tension


class Picture:
    """A network on axes of the plane, whose sites move and take colours.

    Parameters
    ----------
    scene : Network
    ax : matplotlib.axes.Axes or None
    factor : float, optional
        By which displacements are magnified.
    order : ndarray of int, (sites,), optional
        In which sites are drawn, one over the other; from a direction of choice by distance.
    view : tuple of float, (2,), optional
        Azimuth and elevation [degrees] from which a scene in space is seen.
    **style
        Of the disks of sites: colour map and norm where they show values.
    """

    def __init__(
        self,
        scene: Any,
        ax: Axes | None,
        factor: float = 1.0,
        order: Any = None,
        view: tuple[float, float] | None = None,
        **style: Any,
    ) -> None:
        from matplotlib.collections import EllipseCollection, LineCollection
        from matplotlib.colors import to_rgba_array

        self.ax: Axes = plotting.axes(ax)
        self._axes, towards = _axes(scene.dim, view)
        self._factor, places, self._bonds = factor, self._seen(scene.positions), scene.bonds
        self.crowded = scene.radius is None and len(scene.bonds) > CROWDED
        if scene.radius is not None:
            radius = np.asarray(scene.radius)
        else:
            shortest = scene.lengths.min(initial=np.ptp(places) or 1.0)
            radius = np.full(len(places), (FULL if self.crowded else DOT) * shortest)
        self._radius = radius[:, None]
        low, high = (places - self._radius).min(axis=0), (places + self._radius).max(axis=0)
        self._unit, unit = plotting.metres((high - low).max())
        if view is not None:
            order = np.argsort(scene.positions @ towards)
            for line in self._seen(_box(scene.positions, radius)):
                self.ax.plot(*self._unit * line.T, "0.6", lw=0.8, zorder=1)
        for wall in scene.walls if view is None else ():
            line = edge(wall, low, high)
            if line is not None:
                self.ax.plot(*self._unit * line.T, "0.3", lw=1.2, zorder=1)
        if scene.radius is None and not self.crowded:
            lines = self._unit * places[scene.bonds]
            self.ax.add_collection(LineCollection(list(lines), colors="0.7", lw=0.8, zorder=1))
        self._order = np.arange(len(places)) if order is None else order
        self._places, size = places, 2 * self._unit * radius[self._order]
        line = 0.0 if self.crowded else 0.4
        style = {"facecolors": "0.85", "edgecolors": "0.4", "lw": line, "zorder": 2} | style
        self.sites = EllipseCollection(
            size, size, 0 * size, units="xy", offset_transform=self.ax.transData, **style
        )
        self.sites.set_offsets(self._unit * places[self._order])
        self.lines = LineCollection([], capstyle="round", zorder=3)
        self._colours = to_rgba_array(["C0", "C3"])  # of forces: tension, compression
        self.ax.add_collection(self.sites)
        self.ax.add_collection(self.lines)
        self.ax.set(aspect="equal", xlabel=f"x [{unit}]" if unit else "x")
        self._low, self._high = low, high
        self._frame(low, high)
        # a line of force is not wider than a bead
        inches = self.ax.get_position().width * self.ax.figure.get_figwidth()
        points = 72 * inches / np.ptp(self.ax.get_xlim())
        self._widest = min(plotting.WIDEST, float(points * size.min()) / 2)
        if view is not None:
            self.ax.set_axis_off()
        elif scene.dim > 1:
            self.ax.set_ylabel(("y" if scene.dim == 2 else "z") + f" [{unit}]" * bool(unit))
        else:
            self.ax.set_yticks([])
        self.ax.grid(False)

    def _seen(self, x: Array) -> Array:
        """The two coordinates of places (..., dim) that are seen."""
        return x @ self._axes.T

    def _frame(self, low: Array, high: Array) -> None:
        """Show the part between two corners [m]."""
        room = MARGIN * (high - low).max()
        (left, bottom), (right, top) = self._unit * (low - room), self._unit * (high + room)
        self.ax.set(xlim=(left, right), ylim=(bottom, top))

    def make_room(self, u: Array) -> None:
        """Extend the picture to all displacements (T, sites, dim) [m], by at most half its size."""
        moved, most = (
            self._places + self._factor * self._seen(u),
            (self._high - self._low).max() / 2,
        )
        lowest, highest = (moved - self._radius).min((0, 1)), (moved + self._radius).max((0, 1))
        low = np.clip(lowest, self._low - most, self._low)
        self._frame(low, np.clip(highest, self._high, self._high + most))

    def show(self, u: Array, values: Array | None = None) -> None:
        """Displacements (sites, dim) [m] and a value of each site."""
        moved = self._unit * (self._places + self._factor * self._seen(u))
        self.sites.set_offsets(moved[self._order])
        if values is not None:
            self.sites.set_array(np.asarray(values)[self._order])

    def scale(self, shown: Any, label: str) -> None:
        """A scale of the colours, along the longer side of the picture."""
        from matplotlib.colors import PowerNorm
        from matplotlib.ticker import MaxNLocator

        (left, right), (low, high) = self.ax.get_xlim(), self.ax.get_ylim()
        wide = right - left > 2 * (high - low)
        given: dict[str, Any] = {"location": "bottom", "shrink": 0.6} if wide else {"shrink": 0.9}
        if isinstance(shown.norm, PowerNorm):  # large values are close to each other
            top: float = shown.norm.vmax  # type: ignore[assignment]
            ticks = np.asarray(MaxNLocator(4).tick_values(0.0, top))
            given["ticks"] = ticks[ticks <= top * (1 + 1e-9)]
        self.ax.figure.colorbar(shown, ax=self.ax, label=in_units(label), **given)

    def arrows(self, vectors: Array) -> None:
        """An arrow at each site, (sites, dim), the longest a tenth of the picture."""
        seen, size = self._seen(vectors), np.linalg.norm(vectors, axis=-1).max() or 1.0
        longest = 0.1 * np.diff([self.ax.get_xlim(), self.ax.get_ylim()], axis=1).max()
        places = self._unit * self._places
        for axis in ("x", "y"):
            low, high = getattr(self.ax, f"get_{axis}lim")()
            self.ax.set(**{f"{axis}lim": (low - longest, high + longest)})
        given = {"angles": "xy", "scale_units": "xy", "scale": size / longest}
        self.ax.quiver(*places.T, *seen.T, color="C3", zorder=4, width=0.004, **given)

    def paint(self, values: Array, of_sites: bool) -> Any:
        """Sites, or else bonds, in colours of values of either sign; what a scale belongs to."""
        shown = self.sites if of_sites else self.lines
        if not of_sites:
            self.lines.set_segments(list(self._unit * self._places[self._bonds]))
            self.lines.set_linewidth(plotting.WIDEST / 2)
            values = values[: len(self._bonds)]
        most = float(np.abs(values).max(initial=0.0)) or 1.0
        shown.set(array=values, cmap="RdBu_r", clim=(-most, most))
        return shown

    def push(self, ends: Array, tension: Array, widest: float) -> None:
        """Draw forces as lines: compression red, tension blue.

        Parameters
        ----------
        ends : ndarray, (n, 2, dim)
            [m].
        tension : ndarray, (n,)
            [N], extension > 0.
        widest : float
            Force [N] of the widest line.
        """
        size = np.abs(tension)
        order = np.argsort(size)[np.count_nonzero(size == 0) :]
        lines = self._unit * self._seen(ends)
        self.lines.set_segments(list(lines[order]))
        self.lines.set(linewidths=plotting.widths(size[order], widest, self._widest))
        self.lines.set_color(self._colours[(tension[order] < 0).astype(int)])


def _axes(dim: int, view: tuple[float, float] | None) -> tuple[Array, Array]:
    """Axes of the picture in those of the scene, (2, dim), and the direction to who looks (dim,).

    Without a view these are the first and the last axis; of a line 0 is the second coordinate.
    """
    if view is None:
        axes = np.zeros((2, dim))
        axes[0, 0] = 1.0
        axes[1, -1] = float(dim > 1)
        return axes, np.zeros(dim)
    a, e = np.radians(view)
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return np.array([right, np.cross(towards, right)]), towards


def _box(positions: Array, radius: Array) -> Array:
    """The twelve edges of the box about all sites, (12, 2, 3)."""
    low, high = (positions - radius[:, None]).min(axis=0), (positions + radius[:, None]).max(axis=0)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    ends = [(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit]
    return (low + corners * (high - low))[np.array(ends)]


def edge(wall: Wall, low: Array, high: Array) -> Array | None:
    """The line on which a wall is seen.

    Parameters
    ----------
    wall : Wall
    low, high : ndarray, (2,)
        Corners of the picture [m].

    Returns
    -------
    ndarray, (2, 2), or None
        As long as the wall or the picture; None if the wall is seen face on.
    """
    axes = _axes(len(wall.point), None)[0]
    middle, normal = axes @ wall.point, axes @ wall.normal
    size = float(np.linalg.norm(normal))
    if size < 0.5:
        return None
    along = np.array([-normal[1], normal[0]]) / size
    if wall.extent is not None and len(wall.extent):
        half = np.abs(wall.extent @ axes.T @ along).max()
        return middle + np.outer([-half, half], along)
    corners = np.array([(x, z) for x in (low[0], high[0]) for z in (low[1], high[1])])
    places = (corners - middle) @ along
    return middle + np.outer([places.min(), places.max()], along)


def is_string(spring: Any) -> bool:
    """Whether a spring goes slack, and is drawn so."""
    return bool(getattr(spring, "tension_only", spring.kinks))
