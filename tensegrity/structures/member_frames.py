"""Frames of nodes and members, with tensions: what is drawn of structures, modes and paths."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensegrity.frames import Frames
from tensegrity.structures.members import NO_LENGTH
from tensegrity.typing import Array

TURN = 24  # instants of a swing


def of_members(
    shape: Any, title: str, along: str, at: Array, places: Array, tensions: Array, slack: Any
) -> Frames:
    """Frames of a structure at some positions.

    Parameters
    ----------
    shape : Structure or Lattice
    title, along, at, places
        As of `Frames`.
    tensions, slack : ndarray, (instants, members)
        [N]; which members are slack.

    Returns
    -------
    Frames
    """
    each, (first, second) = shape.cable_segments.each, shape.segments.T
    d = places[:, second] - places[:, first] + shape.shift
    lengths = each(shape.cable_segments.over(np.sqrt(np.einsum("tsk,tsk->ts", d, d))))
    pull = np.asarray(each(tensions))
    values = {"tension [N]": pull, "force density [N/m]": pull / np.maximum(lengths, NO_LENGTH)}
    values["slack"] = np.asarray(each(slack))
    string = np.asarray(each(shape.is_string))
    return Frames(title, along, at, places, shape.segments, string, values)


def of_structure(shape: Any) -> Frames:
    """See `Structure.frames`."""
    given = shape.positions[None], shape.tensions[None], shape.slack[None]
    frames = of_members(shape, repr(shape), "", np.zeros(1), *given)
    stiffness = np.where(shape.members.taut(shape.lengths), shape.stiffnesses, 0.0)
    frames.of_segments["stiffness [N/m]"] = shape.cable_segments.each(stiffness)[None]
    return frames


def swinging(shape: Any, motion: Array, title: str) -> Frames:
    """Frames of a structure in one period of a motion about its positions.

    Parameters
    ----------
    shape : Structure
    motion : ndarray, (nodes, dim)
        [m].
    title : str

    Returns
    -------
    Frames
    """
    phase = np.linspace(0.0, 2 * np.pi, TURN, endpoint=False)
    places = shape.positions + np.sin(phase)[:, None, None] * motion
    same = (np.broadcast_to(x, (TURN, len(x))) for x in (shape.tensions, shape.slack))
    frames = of_members(shape, title, "phase [rad]", phase, places, *same)
    frames.of_nodes["displacement [m]"] = places - shape.positions
    return frames
