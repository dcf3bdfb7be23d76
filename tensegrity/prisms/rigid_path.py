"""The path of a prism with rigid bases and bars: the closed form of `derivations.rigid_elastic`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.programs import derived, run
from tensegrity.errors import NoLocking
from tensegrity.prisms.closed import rigid_law
from tensegrity.root import root

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.prisms.prism import Prism
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

    Columns = dict[str, Any]
    Found = tuple[str, int, dict[str, float]]  # kind, row, numbers
    Parts = tuple[list[Columns], list[Found], str, bool]  # end, and whether it begins upright

STATE = ("height", "twist", "base", "load")
ROWS = 200


def rigid_path(prism: Prism, min_height: float, max_load: float, max_height: float | None) -> Parts:
    """Rows of the closed form, closer towards where the prism locks, and events."""
    potential = prism.potential()
    low, _ = potential.domain
    try:
        end, kind = prism.locking_height() - prism.height, "contact"
    except NoLocking:
        end, kind = -prism.height, "flat"
    if min_height - prism.height > end:
        end, kind = min_height - prism.height, "height"

    part = np.linspace(0.0, 1.0, ROWS + 1)
    r = end * (1 - (1 - part) ** 4 if kind == "contact" else part)
    r = r[r > low] if kind != "height" else r
    if kind == "flat":
        r = np.append(r[r > -prism.height], np.nextafter(-prism.height, 0.0))
    load = -potential.tension(r)
    events = []

    turning = potential.stiffness(r)
    for i in np.flatnonzero(turning[:-1] * turning[1:] < 0).tolist():
        at = root(lambda x: float(potential.stiffness(x)), r[i + 1], r[i])
        events.append(("fold", i, at))
    over = np.flatnonzero(load >= max_load)
    if over.size or (kind == "contact" and math.isfinite(max_load)):
        first = int(over[0]) if over.size else len(r)
        nearest = r[first] if over.size else np.nextafter(low, 0)
        at = root(lambda x: -float(potential.tension(x)) - max_load, nearest, r[first - 1])
        r, kind = np.append(r[:first], at), "load"
        events = [event for event in events if event[2] >= at]
    elif kind in ("contact", "flat"):
        events.append((kind, len(r) - 1, end))

    rows, upright = 0, False
    if max_height is not None:
        up = _stretched(prism, potential, max_height)
        r, rows = np.concatenate([up, r]), len(up)
        upright = max_height - prism.height >= potential.domain[1]
    columns = _rigid_columns(prism, potential, r)
    if prism.prestrain == 0:
        events = [("slack", 0, 0.0), *events]
    listed = []
    for name, row, at in events:
        locked = name in ("contact", "flat")
        one = _rigid_columns(prism, potential, np.array([at]), locked)
        numbers_there = {key: float(one[key][0]) for key in STATE}
        if name == "contact":
            numbers_there["load"] = math.inf
        listed.append((name, row + rows, numbers_there))
    return [columns], listed, kind, upright


def _stretched(prism: Prism, potential: Potential, max_height: float) -> Array:
    """Elongations above the reference, the highest first."""
    top = min(max_height - prism.height, potential.domain[1])
    part = np.linspace(1.0, 0.0, ROWS + 1)[:-1]
    r = top * (1 - (1 - part) ** 4)
    return r[r < potential.domain[1]]


def _rigid_columns(prism: Prism, potential: Potential, r: Array, locked: bool = False) -> Columns:
    """Numbers at elongations r; at a locked end no load (0 where flat) and no stiffness."""
    shared = len(rigid_law().parameters)  # without the number of sides
    (half,) = run(derived(_half_turn), np, (r, *potential.values[:shared]))
    load = np.zeros_like(r) if locked else -potential.tension(r)
    stiff = np.full(r.shape, np.inf) if locked else potential.stiffness(r)
    return {
        "height": prism.height + r,
        "twist": prism.reference_twist + 2 * np.arctan(half),
        "base": np.full(r.shape, prism.base),
        "load": load,
        "stable_load": stiff >= 0,  # zero without prestrain, at a minimum of the energy
        "stable_height": np.ones(r.shape, dtype=bool),
    }


def _half_turn() -> tuple[list[Any], tuple[Any, ...]]:
    """Tangent of half the turn from the reference, from constant length of bars and bases."""
    from derivations import rigid_elastic as form

    return [form.half_turn()], (form.elongation, *form.PARAMETERS)
