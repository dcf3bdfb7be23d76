"""Runs as pages, see `Run.show`.

Prisms are drawn with their twists, which follow from their heights along the equilibrium path;
guides, packs, structures and other networks with their sites at their positions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.problem import trace
from tensegrity.errors import TensegrityError
from tensegrity.runs.record import require_all_sites
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.picture import edge, is_string
from tensegrity.springs.provenance import provenance
from tensegrity.viewer.page import Page, corners, few, heading, packed, page

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.frames import Frames
    from tensegrity.typing import Array


def shown(run: Any) -> Page:
    """See `Run.show`."""
    scene = run.scene
    if run._batch:
        raise TensegrityError(f"a run of {len(run)} scenes: take that of one, run[k]")
    require_all_sites(run, " to show")
    if not len(run.t):
        raise TensegrityError("0 instants recorded, must be at least 1 to show")
    if run.u.ndim == 2 and all(
        provenance(scene.springs[k].at(0.0))[1] for k in range(scene.sites - 1)
    ):
        rows = few(len(run.t), run.u[0].size)
        head = heading(repr(scene), "time [s]", run.t[rows])
        return Page(head | _prisms(scene, run.u[rows]), "a run")
    return page_of_scene(scene, run.frames(), "a run")


def page_of_scene(scene: Any, frames: Frames, of: str) -> Page:
    """The page of a scene without prisms.

    Parameters
    ----------
    scene : Scene
    frames : Frames
    of : str
        As of `page`.

    Returns
    -------
    Page
        With the walls of a network in the plane; of a chain that has no beads as disks in a row.
    """
    if len(scene.shape) > 1 or frames.radius is not None:
        return page(frames, of, walls=walls_of(scene, frames.places))
    place = frames.places[0, :, 0]
    lengths = np.array([spring.length or 1.0 for spring in scene.springs][: len(place) - 1])
    ends = [[float(place[0] - lengths[0]), 0.0], [float(place[-1] + lengths[-1]), 0.0]]
    radius = 0.49 * np.minimum(np.append(lengths, lengths[-1]), np.append(lengths[0], lengths))
    bare = replace(frames, of_segments={})
    return page(bare, of, radius=radius.tolist(), bonds=[], bars=[], frame=ends)


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
    tables = {name: packed(values) for name, values in columns.items()}
    return tables | {"strain": packed(strain), "first": float(different[group[0]].length or 0.0)}


def walls_of(scene: Any, places: Array) -> list[Any]:
    """Lines of the walls of a network in the plane [m], as far as they are seen."""
    if getattr(scene, "dim", 1) != 2:
        return []
    lines = [edge(wall, *corners(places, scene.radius)) for wall in scene.walls]
    return [line.tolist() for line in lines if line is not None]


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
    radius = None if scene.radius is None else np.asarray(scene.radius)
    return {
        "dim": scene.dim,
        "radius": None if radius is None else radius.tolist(),
        "bonds": scene.bonds.tolist(),
        "bars": [not is_string(scene.springs[k].at(0.0)) for k in range(len(scene.bonds))],
        "walls": walls_of(scene, places),
        "frame": corners(places, radius).tolist(),
    }
