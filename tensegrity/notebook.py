"""What is seen at work: progress bars, and what objects look like in a notebook.

An object is a small table and a picture, as HTML that stands alone: `_repr_html_` of runs, paths,
waves, prisms, structures and networks call `page`.  Matplotlib is imported when a picture is drawn
and tqdm when a bar is, and not before.
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

from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from matplotlib.figure import Figure

DOTS = 110  # per inch


def page(
    title: str,
    rows: Mapping[str, Any],
    draw: Callable[[Figure], object] | None = None,
    size: tuple[float, float] = (4.6, 3.0),
) -> str:
    """A title, a table of names and values, and beside them a picture.

    Parameters
    ----------
    title : str
    rows : mapping of str
        Values are shown as text; all text is escaped.
    draw : callable (figure) -> None, optional
        Where it raises a TensegrityError there is nothing to see, and no picture.
    size : (float, float), optional
        Of the picture [inches].

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


def progress(total: int, unit: str, done: int = 0) -> Any:
    """A bar of tqdm as a context, from the first second on, in a terminal or a notebook; anywhere
    else one that is still.

    Parameters
    ----------
    total, done : int
        Units in all, and those that were there before.
    unit : str

    Notes
    -----
    To import tqdm takes as long as all of a short run.
    """
    notebook = in_notebook()
    if not notebook and (sys.stderr is None or not sys.stderr.isatty()):
        return nullcontext(SimpleNamespace(n=done, total=total, update=lambda more=1: None))
    if notebook:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # no widgets: a bar of text then
            from tqdm.auto import tqdm
    else:
        from tqdm import tqdm

    return tqdm(total=total, initial=done, unit=unit, unit_scale=True, delay=1.0, leave=False)


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return "IPKernelApp" in getattr(shell, "config", {})
