"""A page of its own, in which frames are played, turned and coloured by tension."""

from __future__ import annotations

import base64
import html
import json
from importlib.resources import files
from os import PathLike
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.frames import Frames
from tensegrity.typing import Array, Indices
from tensegrity.unit_names import is_si, unit_text

NUMBERS = 400_000  # most numbers of a table, which instants share
MOST = 300  # instants
HEIGHT = 430  # pixels of the page in a notebook
LEVELS = 127  # of a tension of either sign
SLACK = -128


class Page:
    """What a notebook shows in a frame, and `save` writes to a file."""

    def __init__(self, data: dict[str, Any], of: str) -> None:
        self._data, self._of = data, of

    def _text(self) -> str:
        parts = files(__package__)
        text = parts.joinpath("viewer.html").read_text(encoding="utf-8")
        for mark in ("viewer.js", "player.js"):
            text = text.replace(f"/*{mark}*/", parts.joinpath(mark).read_text(encoding="utf-8"))
        data = json.dumps(self._data, separators=(",", ":")).replace("</", "<\\/")
        title = html.escape(self._data["title"])
        return text.replace("<!--TITLE-->", title).replace("/*DATA*/null", data)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page to a .html, which any browser opens and which reaches nothing else.

        Parameters
        ----------
        path : str or path
            A file that is there is replaced.

        Raises
        ------
        TensegrityError
            Another suffix, or a file that cannot be written.
        """
        path = check.path("path", path)
        if path.suffix.lower() not in (".html", ".htm"):
            raise TensegrityError(f"path {check.shown(str(path))} must end in .html")
        with check.replacing(path) as new:
            new.write_text(self._text(), encoding="utf-8")

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="{self._of}, played" sandbox="allow-scripts" '
            f'srcdoc="{html.escape(self._text())}" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        count = len(self._data["t"])
        many = f"{count} instants" if count > 1 else "One instant"
        return f"{many} of {self._of}: shown in a notebook, or by save(path) in a browser"


def few(count: int, each: int) -> Indices:
    """Which of the instants with some numbers each are kept: at most 300, evenly, with the ends."""
    most = max(2, min(MOST, NUMBERS // max(1, each)))
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))


def page(frames: Frames, of: str, *, loop: bool = False, **more: Any) -> Page:
    """A page of frames.

    Parameters
    ----------
    frames : Frames
    of : str
        What they are, for readers of the page: "a mode".
    loop : bool, optional
        Whether the first instant follows the last one.
    **more
        Further data of the page, such as the lines of walls.

    Returns
    -------
    Page
    """
    frames = frames.rows(few(len(frames), frames.places[0].size))
    data: dict[str, Any] = heading(frames.title, frames.along, frames.at) | {"loop": loop}
    data |= {"dim": frames.places.shape[-1], "bonds": frames.ends.tolist(), "walls": []}
    radius = frames.radius
    data |= {"bars": (~frames.is_string).tolist(), "frame": corners(frames.places, radius).tolist()}
    data |= {"radius": None if radius is None else radius.tolist()}
    data |= {"places": packed(frames.places)}
    velocity = frames.of_nodes.get("velocity [m/s]")
    if velocity is not None:
        speed = np.linalg.norm(velocity, axis=-1)
        data["shade"] = packed(255 * speed / (speed.max() or 1.0), "u1")
    tension = frames.of_segments.get("tension [N]")
    if tension is not None and tension.size:
        most = float(np.abs(tension).max())
        level = np.rint(LEVELS * tension / (most or 1.0))
        # what is not drawn taut; nothing says so of bonds of a run but their tension
        slack = frames.of_segments.get("slack", frames.is_string & (tension == 0))
        data |= {"tension": packed(np.where(slack, SLACK, level), "i1"), "most": most}
    return Page(data | {"force": unit_text("N")} | more, of)


def heading(title: str, along: str, at: Array) -> dict[str, Any]:
    """Data of a page: the title, and what tells the instants apart.

    Parameters
    ----------
    title, along, at
        As of `Frames`.

    Returns
    -------
    dict
        "title"; "name", "unit" and "t", the values; "si", whether prefixes are written.
    """
    name, _, unit = along.partition(" [")
    return {"title": title, "name": name, "unit": unit.rstrip("]"), "t": at.tolist(),
            "si": is_si()}  # fmt: skip


def corners(places: Array, radius: Array | None) -> Array:
    """The lower and the upper corner of what is seen [m], (2, 2), in space with the depth, (2, 3).

    Parameters
    ----------
    places : ndarray, (..., nodes, dim)
        [m].
    radius : ndarray, (nodes,), or None

    Returns
    -------
    ndarray
        A body in space may turn about the vertical.
    """
    dim = places.shape[-1]
    x = places.reshape(-1, *places.shape[-2:])
    size = 0.0 if radius is None else np.asarray(radius)[:, None]
    low, high = (x - size).min(axis=(0, 1)), (x + size).max(axis=(0, 1))
    seen = {1: [0, 0], 2: [0, 1], 3: [0, 2, 1]}[dim]
    found = np.stack([low[seen], high[seen]])
    if dim == 1:
        found[:, 1] = 0.0
    if dim == 3:
        middle, half = found[:, 0].mean(), np.hypot(*(high - low)[:2]) / 2
        found[:, 0] = middle - half, middle + half
    return found


def packed(values: Array, kind: str = "<f4") -> str:
    """Numbers as bytes in base64, in single precision or as small integers."""
    values = np.rint(values) if kind[-2] != "f" else values
    return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode()
