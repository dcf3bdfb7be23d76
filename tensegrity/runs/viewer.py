"""Runs in a notebook: a page of its own, in which a run is played and turned, see `Run.show`.

Prisms are drawn with their twists, which follow from their heights along the equilibrium path;
guides, packs, structures and other networks with their sites at their positions.
"""

from __future__ import annotations

import base64
import html
import json
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.problem import trace
from tensegrity.errors import TensegrityError
from tensegrity.runs.record import require_all_sites
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.picture import edge, is_string
from tensegrity.springs.provenance import provenance

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

NUMBERS = 400_000  # most numbers of a table, which instants share
MOST = 300  # instants
HEIGHT = 430  # pixels of the page


class Shown:
    """What a notebook shows of a run: a page in a frame, which reaches nothing outside of it."""

    def __init__(self, data: dict[str, Any]) -> None:
        self._data = data

    def _repr_html_(self) -> str:
        parts = files(__package__)
        text = parts.joinpath("viewer.html").read_text(encoding="utf-8")
        for mark in ("viewer.js", "player.js"):
            text = text.replace(f"/*{mark}*/", parts.joinpath(mark).read_text(encoding="utf-8"))
        data = json.dumps(self._data, separators=(",", ":")).replace("</", "<\\/")
        page = html.escape(text.replace("/*DATA*/null", data))
        return (
            f'<iframe title="A run, played" sandbox="allow-scripts" srcdoc="{page}" '
            f'style="width:100%;height:{HEIGHT}px;border:0"></iframe>'
        )

    def __repr__(self) -> str:
        return f"{len(self._data['t'])} instants of a run, shown in a notebook"


def shown(run: Any) -> Shown:
    """See `Run.show`."""
    scene = run.scene
    if run._batch:
        raise TensegrityError(f"a run of {len(run)} scenes: take that of one, run[k]")
    require_all_sites(run, " to show")
    if not len(run.t):
        raise TensegrityError("0 instants recorded, must be at least 1 to show")
    count = max(2, min(MOST, NUMBERS // run.u[0].size))
    rows = np.unique(np.linspace(0, len(run.t) - 1, min(count, len(run.t))).round().astype(int))
    u, v = run.u[rows], run.v[rows]
    speed = np.abs(v) if v.ndim == 2 else np.linalg.norm(v, axis=-1)
    data = {"t": run.t[rows].tolist(), "shade": _packed(speed / (speed.max() or 1.0))}
    if u.ndim > 2:
        places = scene.positions + u
        return Shown(data | drawing(scene, places) | {"places": _packed(places)})
    springs = [scene.springs[k].at(0.0) for k in range(scene.sites - 1)]
    if all(provenance(spring)[1] for spring in springs):
        return Shown(data | _prisms(scene, u))
    lengths = np.array([spring.length or 1.0 for spring in springs])
    place = np.append(0.0, np.cumsum(lengths))
    frame = [[float(place[0] - lengths[0]), 0.0], [float(place[-1] + lengths[-1]), 0.0]]
    radius = 0.49 * np.minimum(np.append(lengths, lengths[-1]), np.append(lengths[0], lengths))
    data |= {"dim": 1, "radius": radius.tolist(), "walls": [], "bonds": [], "frame": frame}
    return Shown(data | {"places": _packed(place + u)})


def _prisms(scene: Chain, u: Array) -> dict[str, Any]:
    """Heights, twists and bases of the prisms of a chain."""
    different, group = dynamics(scene).springs.different, dynamics(scene).springs.group
    elongation = scene.elongation(u)
    columns = {name: np.empty_like(elongation) for name in ("height", "twist", "base")}
    for k, spring in enumerate(different):
        which = group == k
        height: Array = spring.length + elongation[:, which]
        prism = provenance(spring)[1][0]
        above = max(float(height.max()), prism.height) * 1.001
        path = trace(prism.problem(max_height=above)).columns
        order = np.argsort(path["height"])
        columns["height"][:, which] = height
        for name in ("twist", "base"):
            columns[name][:, which] = np.interp(height, path["height"][order], path[name][order])
    strain = elongation / np.array([spring.length for spring in different])[group]
    packed = {name: _packed(values) for name, values in columns.items()}
    return packed | {"strain": _packed(strain), "first": float(different[group[0]].length or 0.0)}


def drawing(scene: Any, places: Array) -> dict[str, Any]:
    """What a canvas needs of a network, whatever its motion.

    Parameters
    ----------
    scene : Network
    places : ndarray, (..., sites, dim)
        Of the sites, all of which are in the frame [m].

    Returns
    -------
    dict
        "dim"; "radius" [m] of the sites or None; "bonds", pairs of sites, and
        "bars", which of them have no kink, as strings have; "walls", lines [m]; and
        "frame", the lower and the upper corner of what is seen [m], in space with the depth.
    """
    x, radius = places.reshape(-1, scene.sites, scene.dim), scene.radius
    size = np.zeros(scene.sites) if radius is None else np.asarray(radius)
    low, high = (x - size[:, None]).min(axis=(0, 1)), (x + size[:, None]).max(axis=(0, 1))
    seen = {1: [0, 0], 2: [0, 1], 3: [0, 2, 1]}[scene.dim]
    corners = np.stack([low[seen], high[seen]])
    if scene.dim == 1:
        corners[:, 1] = 0.0
    if scene.dim == 3:  # it is turned
        middle, half = corners[:, 0].mean(), np.hypot(*(high - low)[:2]) / 2
        corners[:, 0] = middle - half, middle + half
    lines = [edge(wall, *corners) for wall in scene.walls] if scene.dim == 2 else []
    return {
        "dim": scene.dim,
        "radius": None if radius is None else size.tolist(),
        "bonds": scene.bonds.tolist(),
        "bars": [not is_string(scene.springs[k].at(0.0)) for k in range(len(scene.bonds))],
        "walls": [line.tolist() for line in lines if line is not None],
        "frame": corners.tolist(),
    }


def _packed(values: Array) -> str:
    """Numbers as single-precision bytes in base64."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode()
