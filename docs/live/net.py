"""Scenes of the page whose masses are joined in any pattern: beads in a guide and in a pack, and a
row of discs on units with two stable states.  They are shipped as the arrays that the package's own
loop takes, in the order of its structure `scene`."""

from __future__ import annotations

import base64
import math
from ctypes import c_void_p
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from docs.live.kernel import METHOD
from granular import Bead, Striker, hexagonal_pack, materials, y_guide
from tensegrity import Network, Potential, State, catalogue, simulate
from tensegrity.engine.bound import SCENE
from tensegrity.engine.compiled import compiled
from tensegrity.engine.kernel import bind
from tensegrity.runs.viewer import drawing
from tensegrity.scenes.dynamics import dynamics

BEAD = Bead(diameter=10e-3, material=materials["steel"])
SPEED = 1.0  # m/s, of the strikers
DISCS, LONG = 40, 50.0  # sites; m to the anchors, along the row
PRESTRAIN, TORQUE = 0.28, 3e-3  # of the units; N m
COUPLING, DASHPOT, BLOW = 0.05, 0.1, 0.2  # N m/rad; N m s/rad; rad/s
FRAMES = 480  # that a run takes
KINDS = {"f8": "f", "i8": "l", "i4": "i", "u1": "b"}


@cache
def scenes() -> dict[str, dict[str, Any]]:
    """Scene, first state, seconds, and words of each."""
    striker = Striker(BEAD, speed=SPEED)
    guide = y_guide(stem=12, branch=14, bead=BEAD, striker=striker)
    pack = hexagonal_pack(7, 12, bead=BEAD, striker=striker, sides=materials["steel"],
                          floor=materials["steel"])  # fmt: skip
    row, start = _discs()
    of_beads = {"of": "speed", "most": 3.0, "unit": "m/s"}
    return {
        "Y-guide": {
            "scene": guide, "start": guide.start(), "last": 6e-4, "hit": SPEED, **of_beads,
            "note": "A steel bead strikes a stem that splits into two branches of steel beads, in "
            "a guide of PTFE walls. The pulse divides at the junction, and part of it returns.",
        },
        "Pack": {
            "scene": pack, "start": pack.start(), "last": 2e-4, "hit": SPEED, **of_beads,
            "note": "A steel bead strikes a hexagonal pack of steel beads from above: forces "
            "spread along two rows of contacts.",
        },
        "Switching front": {
            "scene": row, "start": start, "last": 500.0, "hit": BLOW, "of": "state", "most": 0.25,
            "unit": "rad/s", "drag": DASHPOT, "dt": 0.2, "least": float(start.u[0, 0]),
            "note": "Discs on springs with two stable twists, of which a torque makes one the "
            "lower. A blow that carries the first disc over the barrier switches all of them; a "
            "weaker one dies out.",
        },
    }  # fmt: skip


def unit() -> Potential:
    """The spring of a disc to the ground."""
    return catalogue.twin_strings(sides=4, prestrain=PRESTRAIN, torque=TORQUE)


def _discs():
    """The row of discs as a network on a line: bonds to held anchors stretch by the twists."""
    ground, r, place = unit(), sp.Symbol("r"), np.arange(DISCS)
    coupling = Potential(COUPLING * r**2 / 2, r)
    upper = -0.35
    for _ in range(20):  # Newton's method: the upper well
        upper -= float(ground.tension(upper) / ground.stiffness(upper))
    positions = np.zeros((2 * DISCS, 2))
    positions[:, 0] = np.concatenate([place, place - LONG])
    bonds = [(j, j + 1) for j in place[:-1]] + [(DISCS + j, j) for j in place]
    springs = [coupling] * (DISCS - 1) + [ground] * DISCS
    row = Network(positions, bonds, springs, held=range(DISCS, 2 * DISCS))
    u, v = np.zeros((2, *positions.shape))
    u[:DISCS, 0], v[0, 0] = upper, BLOW
    return row, State(u, v)


def laws() -> tuple[Any, ...]:
    """The laws of all scenes."""
    return tuple(dict.fromkeys(law for one in scenes().values() for law in _bonds(one).laws))


def _bonds(given):
    return dynamics(given["scene"]).loop_bonds


def tables() -> dict[str, Any]:
    """What the page is given."""
    return {name: _table(given) for name, given in scenes().items()}


def _table(given):
    scene, start, own, every = given["scene"], given["start"], _bonds(given), laws()
    dt = given.get("dt") or simulate(scene, start, given["last"], method=METHOD).dt
    most = max(len(law.parameters) for law in every)
    bonds = replace(
        own,
        laws=every,
        law=np.array([every.index(own.laws[k]) for k in own.law]),
        parameters=np.pad(own.parameters, ((0, 0), (0, most - own.parameters.shape[1]))),
    )
    loop = compiled(every, (None,) * len(every), 2, 1)
    bound = bind(*dynamics(scene).arrays(start), bonds, METHOD, dt, loop, divided=False)
    bound.forget()
    fields = bound._scene.filled
    parts = {name: [min(sites), max(sites)] for name, sites in getattr(scene, "parts", {}).items()}
    drag = given.get("drag", 0.0)
    words = {key: given[key] for key in ("note", "last", "hit", "of", "most", "unit")}
    return words | drawing(scene, scene.positions) | {
        "fields": [_field(fields[name]) for name in SCENE.kinds],
        "pointers": [kind is c_void_p for kind in SCENE.kinds.values()],
        "names": list(SCENE.kinds),
        "dt": dt,
        "steps": math.ceil(given["last"] / dt / FRAMES),
        "decay": math.exp(-drag * dt / 2),
        "parts": parts,
        "discs": DISCS if drag else 0,
        "least": given.get("least", 0.0),
        "mass": scene.mass.tolist(),
        "places": scene.positions.ravel().tolist(),
    }  # fmt: skip


def _field(value):
    """A field for the page: a number, or an array as its kind, length and bytes where not all 0."""
    if not isinstance(value, np.ndarray):
        return int(value or 0)
    data = base64.b64encode(value.tobytes()).decode() if value.any() else ""
    return [KINDS[value.dtype.str[1:]], value.size, data]
