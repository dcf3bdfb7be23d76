"""Animations of runs: `animate` writes a run as a film, `moving` draws its instants on given axes.

A chain is the profile of its elongations, velocities or energies.  Guides, packs and other
networks are maps: sites move and take colours, and the forces between them are lines as wide as
the force; of structures of more than 2,000 members the sites alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.runs.record import require_all_sites
from tensegrity.runs.run import Run
from tensegrity.scenes.picture import Picture, forces
from tensegrity.scenes.scene import Scene
from tensegrity.typing import Array, Count, NotNegative, Positive, Preload
from tensegrity.unit_names import in_units, is_si, unit_text

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

DOTS = 90  # per inch, of a film
LONGEST, BESIDE = 7.0, 1.5  # inches: of a film, and for labels and a scale
ROOM = 0.05  # of the range of a profile, left free above and below
LABELS = {
    "elongation": "elongation [m]",
    "velocity": "velocity [m/s]",
    "speed": "speed [m/s]",
    "energy": "energy per site [J]",
}
OF_CHAINS, OF_NETWORKS = ("elongation", "velocity", "energy"), ("speed", "energy")


@checked
def animate(
    run: Run,
    path: str | PathLike[str],
    show: str | ArrayLike | None = None,
    *,
    frames: Count = 100,
    rate: float = 12.0,
    factor: Positive = 1.0,
    label: str = "",
    view: tuple[float, float] | None = None,
) -> None:
    """Write a run as a film.

    Parameters
    ----------
    run : Run
        With all sites recorded; its rows are the instants that can be shown.
    path : str or path
        Of a .gif, or of a .mp4, which needs the program ffmpeg.
    show : str or array_like (T, sites), optional
        Of a chain "elongation" (default), "velocity" or "energy", against bond or site; of a
        network the colours of the sites, "speed" (default) or "energy".  Or given values
        for each recorded instant and site.
    frames : int, optional
        Largest number of frames, >= 1, evenly spaced among the recorded instants.
    rate : float, optional
        Frames in a second, at least 0.01.
    factor : float, optional
        Magnification of the displacements in a map, > 0.
    label : str, optional
        Name and unit of given values.
    view : (float, float), optional
        Azimuth and elevation [degrees] from which a network in space is seen; sites are the more
        transparent the smaller their value is.  By default it is seen along its second axis.

    Raises
    ------
    TensegrityError
        No run, or one of an ensemble; sites or instants that were not recorded; a path that does
        not end in .gif or .mp4; a .mp4 without ffmpeg; a file that cannot be written.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, animate, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=40)
    >>> run = simulate(chain, chain.at_rest({0: 0.1}), 60.0)
    >>> animate(run, "wave.gif", show="velocity")  # doctest: +SKIP
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=plotting.SIZE, dpi=DOTS, layout="constrained")
    ax = figure.subplots()
    draw = moving(run, ax, show, factor=factor, label=label, view=view)
    if run.u.ndim > 2:
        figure.set_size_inches(*_fitting(ax))
    count = len(run.t)
    rows = np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(int))
    plotting.film(path, figure, rows.tolist(), draw, rate)


@checked
def moving(
    run: Run,
    ax: Axes | None = None,
    show: str | ArrayLike | None = None,
    *,
    factor: Positive = 1.0,
    top: NotNegative | None = None,
    widest: Preload | None = None,
    label: str | None = "",
    view: tuple[float, float] | None = None,
) -> Callable[[int], list[Artist]]:
    """Draw a run on axes; returns what shows one of its recorded instants there.

    Parameters
    ----------
    run, show, factor, label, view
        As of `animate`; a label of None leaves out the scale of the colours.
    ax : matplotlib.axes.Axes, optional
        By default of a new figure.
    top : float, optional
        Value at the upper end of the colours of a map; by default the largest that is shown.
    widest : float, optional
        Force [N] of the widest line of a map, and of all that carry more; by default the median,
        over the instants, of the largest force.

    Returns
    -------
    callable (int) -> list of matplotlib.artist.Artist
        Takes the number of a recorded instant; returns what has changed.

    Raises
    ------
    TensegrityError
        As `animate`.
    """
    scene = run.scene
    if not isinstance(scene, Scene):
        raise TensegrityError(f"a run of {type(scene).__name__}: take that of one scene")
    require_all_sites(run, " to animate")
    if not len(run.t):
        raise TensegrityError("0 instants recorded, must be at least 1 to animate")
    if label is not None:
        check.kind("label", label, str)
    if view is not None:
        view = tuple(check.vector("view", view, (2,)).tolist())
        if getattr(scene, "dim", 1) != 3:
            raise TensegrityError(f"view {view} of a scene that is not in space: leave it out")
    values, words = _values(run, show, label or "")
    if run.u.ndim == 2:
        return _profile(run, plotting.axes(ax), values, words)
    colours = plotting.rooted(float(values.max()) if top is None else top)
    if view is not None:
        colours |= {"cmap": plotting.clearing(colours["cmap"]), "edgecolors": "face"}
    order = np.argsort(values.max(axis=0))
    picture = Picture(scene, ax, factor, order, view, facecolors=None, **colours)
    picture.make_room(run.u)
    picture.show(run.u[0], values[0])
    if label is not None:
        picture.scale(picture.sites, words)
    if widest is None and not picture.crowded:
        largest = [float(np.abs(forces(scene, u)[1]).max(initial=0.0)) for u in run.u]
        widest = float(np.median(largest))
    widest = widest or 0.0
    magnified = "" if factor == 1 else f", displacements x {factor:g}"
    words = "" if picture.crowded else f"; widest line {widest:.3g} N"

    def draw(row: int) -> list[Artist]:
        picture.show(run.u[row], values[row])
        if not picture.crowded:
            picture.push(*forces(scene, run.u[row], factor), widest)
        title = f"{_time(run, row)}{in_units(words)}{magnified}"
        return [picture.sites, picture.lines, picture.ax.set_title(title, fontsize=9)]

    return draw


def _fitting(ax: Axes) -> tuple[float, float]:
    """Size [inches] of a figure of a map, with room for its labels and its scale."""
    wide, high = np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())
    if wide > high:
        return LONGEST, float(max(LONGEST * high / wide + BESIDE, LONGEST / 2))
    return float(max(LONGEST * wide / high + BESIDE, LONGEST / 2)), LONGEST


def _values(run: Run, show: Any, label: str) -> tuple[Array, str]:
    """What is shown of every instant, (T, sites or bonds), and in words."""
    scene, known = run.scene, OF_CHAINS if run.u.ndim == 2 else OF_NETWORKS
    show = known[0] if show is None else show
    if not isinstance(show, str):
        return check.vector("show", show, (len(run.t), scene.sites)), label
    if show not in known:
        raise TensegrityError(f"show {check.shown(show)} must be one of {', '.join(known)}")
    if show == "elongation":
        return scene.elongation(run.u), LABELS[show]
    if show == "velocity":
        return run.v, LABELS[show]
    if show == "speed":
        return np.linalg.norm(run.v, axis=-1), LABELS[show]
    return scene.site_energy(run), LABELS[show]


def _profile(run: Run, ax: Axes, values: Array, words: str) -> Callable[[int], list[Artist]]:
    """Values along a chain."""
    if words == LABELS["energy"]:  # a logarithmic axis takes long to draw
        largest = float(values.max()) or 1.0
        values = np.log10(np.maximum(values / largest, plotting.FAINTEST))
        words = f"log$_{{10}}$(energy per site / {largest:.3g} J)"
    low, high = float(values.min()), float(values.max())
    room = ROOM * (high - low) or 1.0
    place = np.arange(values.shape[1])
    (line,) = ax.plot(place, values[0], lw=1.2)
    ax.set(xlabel="site" if len(place) == run.scene.sites else "bond", ylabel=in_units(words))
    ax.set(xlim=(0, len(place) - 1), ylim=(low - room, high + room))

    def draw(row: int) -> list[Artist]:
        line.set_ydata(values[row])
        return [line, ax.set_title(_time(run, row), fontsize=10)]

    return draw


def _time(run: Run, row: int) -> str:
    """An instant, of a width that stays."""
    end, t = float(run.t[-1]), float(run.t[row])
    units = ((1.0, unit_text("s")), (1e3, "ms"), (1e6, "µs"))[: 3 if is_si() else 1]
    factor, unit = next((pair for pair in units if pair[0] * end >= 1), units[-1])
    return f"t = {factor * t:.2f} {unit}"
