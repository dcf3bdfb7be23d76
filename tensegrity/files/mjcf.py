"""Structures as models of MuJoCo: bars are rigid bodies, strings tendons.

A bar has the mass and inertia of a rod with the masses of its nodes at its ends.  A node in no bar
is a body that slides; bars that share a node are held together there, which MuJoCo does softly.
Source: MuJoCo, XML reference.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.files.geometry import in_space
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array, Duration

AXIAL = 1e-4  # inertia about its axis over that across it, of a rod without thickness


@checked
def write_mjcf(
    path: Path,
    structure: Structure,
    *,
    gravity: Annotated[float, "m/s^2"] = 0.0,
    dt: Duration = 1e-3,
) -> None:
    """A model of a structure.

    Parameters
    ----------
    path : Path
    structure : Structure
        Whose bars and nodes outside of bars have mass; laws, buckling and platforms are refused.
    gravity : float, optional
        Acceleration against the last axis [m/s^2].
    dt : float, optional
        Step [s].

    Raises
    ------
    TensegrityError
        What a model does not hold, or a body without mass.
    """
    check.kind("thing", structure, Structure)
    held = {"law": structure.law, "buckling": structure.buckling is not None}
    held |= {"platforms": structure.platforms}
    for name, given in held.items():
        if given:
            raise TensegrityError(f"{name} of the structure: a model of MuJoCo does not hold it")
    strings = structure.is_string
    if structure.member_mass[strings].any():
        raise TensegrityError("string_mass: tendons have no mass, put it at the nodes")
    places, mass, bodies, joints = in_space(structure.positions), structure.mass, "", ""
    first: dict[int, int] = {}  # node: the first bar that has it
    for bar, ends in enumerate(structure.ends[: structure.bars].tolist()):
        own = np.array([0.0 if node in first else mass[node] for node in ends])
        text, along = _bar(structure, bar, places[ends], own)
        for node, z in zip(ends, along, strict=True):
            if node in first:
                at = f'body1="bar{bar}" body2="bar{first[node]}" anchor="0 0 {z!r}"'
                joints += f"<connect {at}/>\n"
            else:
                first[node] = bar
                text += f'<site name="node{node}" pos="0 0 {z!r}"/>\n'
        bodies += f"{text}</body>\n"
    for node in [n for n in range(structure.nodes) if n not in first]:
        heavy = _mass(mass[node], f"node {node}")
        slides = "".join(f'<joint type="slide" axis="{_text(axis)}"/>' for axis in np.eye(3))
        bodies += (
            f'<body pos="{_text(places[node])}">{slides}<inertial pos="0 0 0" mass="{heavy!r}" '
            f'diaginertia="{_text([heavy] * 3)}"/><site name="node{node}"/></body>\n'
        )
    tendons = ""
    for member in np.flatnonzero(strings).tolist():
        parts = structure.segments[structure.cable_segments.of(member)]
        sites = "".join(f'<site site="node{n}"/>' for n in (parts[0, 0], *parts[:, 1]))
        k, natural = float(structure.stiffnesses[member]), float(structure.natural_lengths[member])
        tendons += (
            f'<spatial name="string{member}" stiffness="{k!r}" springlength="0 {natural!r}">'
            f"{sites}</spatial>\n"
        )
    down = np.zeros(3)
    down[structure.dim - 1] = -gravity
    text = (
        f'<mujoco>\n<option integrator="RK4" timestep="{dt!r}" gravity="{_text(down)}"/>\n'
        f"<worldbody>\n{bodies}</worldbody>\n<tendon>\n{tendons}</tendon>\n"
        f"<equality>\n{joints}</equality>\n</mujoco>\n"
    )
    with check.replacing(path) as new:
        new.write_text(text, encoding="utf-8")


def _bar(structure: Structure, bar: int, ends: Array, own: Array) -> tuple[str, list[float]]:
    """The start of the body of a bar (its axis is z, its origin the centre of mass), with masses of
    its own at its ends (2, 3), and the places of these along it."""
    length, rod = float(np.linalg.norm(ends[1] - ends[0])), float(structure.member_mass[bar])
    whole = _mass(rod + float(own.sum()), f"bar {bar}")
    centre = (rod / 2 + float(own[1])) / whole * length
    along = np.array([-centre, length - centre])
    across = rod * (length**2 / 12 + (length / 2 - centre) ** 2) + float(own @ along**2)
    axis = (ends[1] - ends[0]) / length
    inertia = _text([across, across, AXIAL * across])
    text = (
        f'<body name="bar{bar}" pos="{_text(ends[0] + centre * axis)}" zaxis="{_text(axis)}">\n'
        f'<freejoint/>\n<inertial pos="0 0 0" mass="{whole!r}" diaginertia="{inertia}"/>\n'
        f'<geom type="capsule" fromto="0 0 {-centre!r} 0 0 {length - centre!r}" mass="0" '
        f'size="{length / 100!r}" contype="0" conaffinity="0"/>\n'
    )
    return text, along.tolist()


def _mass(mass: float, name: str) -> float:
    if not mass > 0:
        raise TensegrityError(f"{name} has mass 0 kg, must be above 0: give bar_mass= or mass=")
    return float(mass)


def _text(values: Any) -> str:
    """Numbers with all digits."""
    return " ".join(repr(float(x)) for x in values)
