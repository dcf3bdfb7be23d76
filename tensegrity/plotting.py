"""Parts of pictures: axes, members, disks, lines of force, and frames written as a film.

Nothing here knows a scene; `plot` of structures, networks and runs is made of these parts.
Matplotlib is imported when something is drawn, and not before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.notebook import progress
from tensegrity.unit_names import in_units, is_si, unit_text

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Frame = TypeVar("Frame")

SIZE = 7.0, 4.5  # inches, of a new figure
FAINTEST = 1e-4  # of the largest value: the lower end of logarithmic colours
CLEAREST = 0.06  # opacity of the smallest value
WIDEST, THINNEST = 5.0, 0.05  # points: lines of the largest force, and of the least that is drawn
FORMATS = (".gif", ".mp4")
SLOWEST = 0.01  # frames in a second


def axes(ax: Any = None, in_space: bool = False) -> Any:
    """Matplotlib's axes.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default a new figure.
    in_space : bool, optional
        Whether they must have three axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    TensegrityError
        Not a Matplotlib axes, or one with two axes where three are needed, or the reverse.
    """
    from matplotlib.axes import Axes

    if ax is None:
        import matplotlib.pyplot as plt

        return subplot(plt.figure(figsize=SIZE, layout="constrained"), in_space)
    check.kind("ax", ax, Axes)
    if in_space != (ax.name == "3d"):
        wanted = "have projection='3d'" if in_space else "be of the plane"
        raise TensegrityError(f"ax has projection {ax.name!r}, must {wanted}")
    return ax


def subplot(figure: Any, in_space: bool) -> Any:
    """Axes that fill a figure, of the plane or in space."""
    return figure.add_subplot(projection="3d" if in_space else None)


def metres(size: float) -> tuple[float, str]:
    """Factor and name of the unit in which lengths of this size [m] are read easily."""
    return (1e3, "mm") if size < 0.5 and is_si() else (1.0, unit_text("m"))


def logarithmic(values: NDArray[np.float64], colours: str = "viridis") -> dict[str, Any]:
    """Colour map and norm of values >= 0, down to `FAINTEST` of the largest."""
    from matplotlib.colors import LogNorm

    largest = values.max(initial=0.0) or 1.0
    return {"cmap": colours, "norm": LogNorm(FAINTEST * largest, largest, clip=True)}


def rooted(largest: float) -> dict[str, Any]:
    """Colour map and norm of values from 0 to the largest, which resolve small values:
    by their square root."""
    from matplotlib.colors import PowerNorm

    return {"cmap": "Greys", "norm": PowerNorm(0.5, 0.0, largest or 1.0, clip=True)}


def dark() -> Any:
    """A colour map of which every colour stands out from white: lines may have it."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["plasma"](np.linspace(0.0, 0.6, 256)))


def clearing(name: str) -> Any:
    """A colour map whose lower end is transparent."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    shades = np.linspace(0.0, 1.0, 256)
    colours = colormaps[name](0.25 + 0.75 * shades)
    colours[:, 3] = CLEAREST + (1 - CLEAREST) * shades**1.5
    return ListedColormap(colours)


def members(
    ax: Axes,
    positions: NDArray[np.float64],
    ends: NDArray[np.intp],
    is_string: NDArray[np.bool_],
    slack: NDArray[np.bool_],
    tensions: NDArray[np.float64],
) -> None:
    """Draw bars thick, taut strings in the colours of their tension and slack strings dashed.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Of the dimension of the positions.
    positions : ndarray, (nodes, 2 or 3)
        [m].
    ends : ndarray of int, (members, 2)
    is_string, slack : ndarray of bool, (members,)
    tensions : ndarray, (members,)
        [N].
    """
    from matplotlib.collections import LineCollection

    factor, unit = metres(np.ptp(positions, axis=0).max())
    lines, dim = factor * positions[ends], positions.shape[1]
    kind: Any = LineCollection
    if dim == 3:
        kind = import_module("mpl_toolkits.mplot3d.art3d").Line3DCollection
    taut, largest = is_string & ~slack, tensions[is_string].max(initial=0.0)
    colours: dict[str, Any] = {"colors": "C0"}
    if largest > 0:
        colours = {"array": tensions[taut], "cmap": dark(), "clim": (0.0, largest)}
    styles: list[tuple[Any, str, dict[str, Any]]] = [
        (~is_string, "bars", {"colors": "0.15", "linewidths": 3.0}),
        (taut, "strings", {"linewidths": 1.6, **colours}),
        (slack, "slack strings", {"colors": "C3", "linewidths": 1.2, "linestyles": "--"}),
    ]
    for chosen, label, style in styles:
        if chosen.any():
            drawn = ax.add_collection(kind(lines[chosen], label=label, **style))
            if "array" in style:
                ax.figure.colorbar(
                    drawn, ax=ax, label=in_units("tension of strings [N]"), shrink=0.75
                )
    low, high = (f(factor * positions, axis=0) for f in (np.min, np.max))
    room = 0.05 * (high - low).max()
    limits = {f"{name}lim": (low[k] - room, high[k] + room) for k, name in enumerate("xyz"[:dim])}
    ax.set(
        **limits, **{f"{name}label": f"{name} [{unit}]" if unit else name for name in "xyz"[:dim]}
    )
    if dim == 3:
        ax.set_box_aspect(high - low + 2 * room, zoom=0.85)  # type: ignore[call-arg]
        ax.locator_params(nbins=4)
    else:
        ax.set_aspect("equal")
    if slack.any():
        ax.legend(frameon=False, fontsize=8, loc="upper left")


def widths(
    force: NDArray[np.float64], widest: float, points: float = WIDEST
) -> NDArray[np.float64]:
    """Line widths proportional to forces.

    Parameters
    ----------
    force : ndarray
        Magnitudes [N].
    widest : float
        Force [N] of the widest line; larger forces get the same width.
    points : float, optional
        Width of the widest line [points].

    Returns
    -------
    ndarray, shape of force
        [points].
    """
    return np.clip(points * force / (widest or 1.0), THINNEST, max(points, THINNEST))


def film(
    path: str | PathLike[str],
    figure: Figure,
    frames: Iterable[Frame],
    show: Callable[[Frame], Iterable[Artist] | None],
    rate: float = 12.0,
) -> None:
    """Write a figure as it is after `show(frame)`, for each frame, as a film.

    A bar counts the frames, in a terminal.

    Parameters
    ----------
    path : str or path
        Of a .gif or a .mp4, written under another name and renamed.
    figure : matplotlib.figure.Figure
        Of a size that stays.
    frames : iterable
    show : callable (frame) -> iterable of matplotlib.artist.Artist, or None
        Changes what is drawn.  If it returns which artists of axes it changes, always the same,
        the rest is drawn once: what lies below them.
    rate : float, optional
        Frames in a second, at least 0.01.

    Raises
    ------
    TensegrityError
        Another ending of the path; a .mp4 without the program ffmpeg; a file that cannot be
        written.
    """
    path = check.path("path", path)
    rate = check.number("rate", rate, least=SLOWEST, unit="frames/s")
    if path.suffix.lower() not in FORMATS:
        raise TensegrityError(f"path {check.shown(str(path))} must end in {' or '.join(FORMATS)}")
    from matplotlib import animation

    mp4 = path.suffix.lower() == ".mp4"
    if mp4 and not animation.FFMpegWriter.isAvailable():
        raise TensegrityError(
            f"{path}: a .mp4 needs the program ffmpeg, which is not there; a .gif needs none"
        )
    listed = list(frames)
    with check.replacing(path) as new, progress(len(listed), "frame") as bar:
        write = _mp4 if mp4 else _gif
        write(new, figure, _counted(listed, bar), show, rate)


def _counted(frames: Iterable[Frame], bar: Any) -> Iterator[Frame]:
    for frame in frames:
        yield frame
        bar.update()


def _mp4(new: Any, figure: Any, frames: Any, show: Any, rate: float) -> None:
    from matplotlib.animation import FFMpegWriter

    writer = FFMpegWriter(fps=rate, extra_args=["-f", "mp4"])  # type: ignore[arg-type]
    with writer.saving(figure, str(new), figure.dpi):
        for frame in frames:
            show(frame)
            writer.grab_frame()
            figure.set_layout_engine("none")


def _gif(new: Any, figure: Any, frames: Any, show: Any, rate: float) -> None:
    from PIL import Image

    first, *rest = (
        Image.fromarray(image).convert("RGB").quantize(method=Image.Quantize.FASTOCTREE)
        for image in drawn(figure, frames, show)
    )
    first.save(new, "GIF", save_all=True, append_images=rest, duration=round(1000 / rate), loop=0)


def drawn(
    figure: Figure, frames: Iterable[Frame], show: Callable[[Frame], Iterable[Artist] | None]
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a figure after `show(frame)`, for each frame, all laid out as the first.

    Parameters
    ----------
    figure, frames, show
        As of `film`.

    Yields
    ------
    ndarray of uint8, (height, width, 4)
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    still: Any = None
    again: list[Any] = []
    try:
        for number, frame in enumerate(frames):
            moving = list(show(frame) or ())
            if number and moving:
                if still is None:
                    again = _from_lowest(moving)
                    for artist in again:
                        artist.set_animated(True)  # left out when the whole is drawn
                    canvas.draw()
                    still = canvas.copy_from_bbox(figure.bbox)
                canvas.restore_region(still)
                for artist in again:
                    artist.draw(canvas.get_renderer())
            else:
                canvas.draw()
                figure.set_layout_engine("none")
            yield np.array(canvas.buffer_rgba())
    finally:
        for artist in again:
            artist.set_animated(False)


def _from_lowest(moving: list[Any]) -> list[Any]:
    """Artists, and all that is drawn over the lowest of them in its axes, in this order."""
    from matplotlib.axis import Axis
    from matplotlib.spines import Spine
    from matplotlib.text import Text

    found: list[Any] = []
    for ax in dict.fromkeys(artist.axes for artist in moving):
        lowest = min(artist.zorder for artist in moving if artist.axes is ax)
        frame = () if ax.axison else (Axis, Spine)
        for artist in sorted(ax.get_children(), key=lambda artist: artist.zorder):
            below = artist is ax.patch or artist.zorder < lowest or isinstance(artist, frame)
            beside = isinstance(artist, Text) and not artist.get_window_extent().overlaps(ax.bbox)
            if artist in moving or not (below or beside):
                found.append(artist)
    return found
