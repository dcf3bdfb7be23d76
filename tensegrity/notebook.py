"""Progress bars, and the display of objects in a notebook.

An object is displayed as a small table and a picture in self-contained HTML: `_repr_html_` of runs,
paths, waves, prisms, structures and networks call `page`.  Matplotlib and tqdm are imported only
when a picture or a bar is drawn.
"""

from __future__ import annotations

import base64
import html
import io
import sys
import warnings
from contextlib import nullcontext
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

DOTS = 110  # per inch
VIEW = 0.5, 0.3  # direction of view [rad]: azimuth and elevation


def page(
    title: str,
    rows: Mapping[str, Any],
    draw: Callable[[Figure], object] | None = None,
    size: tuple[float, float] = (4.6, 3.0),
) -> str:
    """A title, a table of names and values, and a picture next to them.

    Parameters
    ----------
    title : str
    rows : mapping of str
        Values are shown as text; all text is escaped.
    draw : callable (figure) -> None, optional
        Draws the picture; there is none where it raises a TensegrityError.
    size : (float, float), optional
        Width and height of the picture [inches].

    Returns
    -------
    str
        HTML.
    """
    cells = "".join(
        '<tr><th style="text-align:left;font-weight:normal;opacity:0.7;padding-right:1em">'
        f"{html.escape(name)}</th>"
        f'<td style="text-align:left">{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    picture = _picture(draw, size, title) if draw else ""
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start">'
        f"<div><b>{html.escape(title)}</b><table>{cells}</table></div>{picture}</div>"
    )


def _picture(draw: Callable[[Figure], object], size: tuple[float, float], title: str) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    try:
        draw(figure)
    except TensegrityError:
        return ""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DOTS)
    data = base64.b64encode(file.getvalue()).decode()
    width = f"{size[0] * 96:.0f}"
    return f'<img alt="{html.escape(title)}" width="{width}" src="data:image/png;base64,{data}">'


def wires(axes: Axes, positions: ArrayLike, ends: ArrayLike, bars: int = 0) -> None:
    """Draw members as lines, seen obliquely from above.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    positions : array_like, (nodes, 1 to 3)
        [m].
    ends : array_like, (members, 2)
    bars : int, optional
        Number of members, the first ones, that are drawn thick.
    """
    places, pairs = np.asarray(positions, dtype=float), np.asarray(ends, dtype=int).reshape(-1, 2)
    if places.shape[1] == 1:
        places = np.column_stack([places, np.zeros(len(places))])
    elif places.shape[1] == 3:
        (around, above), (x, y, z) = VIEW, places.T
        across = x * np.cos(around) + y * np.sin(around)
        depth = y * np.cos(around) - x * np.sin(around)
        places = np.column_stack([across, z * np.cos(above) + depth * np.sin(above)])
    from matplotlib.collections import LineCollection

    segments = places[pairs]
    axes.add_collection(LineCollection(list(segments[bars:]), colors="0.45", linewidths=1.0))
    axes.add_collection(LineCollection(list(segments[:bars]), colors="C0", linewidths=3.0))
    axes.plot(*places.T, "o", color="0.2", ms=3)
    axes.set_aspect("equal")
    axes.axis("off")


def progress(total: int, unit: str, done: int = 0) -> Any:
    """A progress bar as a context; it is drawn after one second in a terminal or a notebook, and
    nowhere else.

    Parameters
    ----------
    total, done : int
        Number of units in all, and of those done before.
    unit : str

    Returns
    -------
    context manager
        Its value has `n`, `total` and `update(more)`.

    Notes
    -----
    tqdm is imported only where a bar is drawn, as its import takes as long as a short run.
    """
    notebook = in_notebook()
    if not notebook and (sys.stderr is None or not sys.stderr.isatty()):
        return nullcontext(SimpleNamespace(n=done, total=total, update=lambda more=1: None))
    if notebook:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without widgets the bar is text
            from tqdm.auto import tqdm
    else:
        from tqdm import tqdm

    return tqdm(total=total, initial=done, unit=unit, unit_scale=True, delay=1.0, leave=False)


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return "IPKernelApp" in getattr(shell, "config", {})
