"""The equilibrium path of a prism with elastic bases or bars, by continuation of `equations`.

Rigid bases leave one unknown less.  Beyond the twist at which base strings unload, the upright
cross strings alone carry the load, in closed form.  Source: the talk, part III, "Numerical
approach".
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.continuation import Settings, trace
from tensegrity.engine.programs import derived, run
from tensegrity.prisms.closed import STATE
from tensegrity.prisms.condensed import stable
from tensegrity.prisms.equations import kind_of, numbers, problem

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from tensegrity.branches.continuation import Branch
    from tensegrity.prisms.closed import Columns, LocatedEvent, PathParts
    from tensegrity.prisms.prism import Prism

ROWS = 200  # number of rows where base strings are slack
SETTINGS = Settings(tolerance=1e-8, largest=0.05)
FLAT = {"height": 0.0, "load": 0.0}  # exact by symmetry


def elastic_path(
    prism: Prism, min_height: float, max_load: float, max_height: float | None, past_contact: bool
) -> PathParts:
    """Rows and events; states in tension, if requested, precede the reference.

    Parameters
    ----------
    prism : Prism
        With elastic bases or bars.
    min_height : float
        Height at which the path ends [m].
    max_load : float
        Axial load at which it ends [N], compression > 0.
    max_height : float or None
        Height up to which the tension side is included [m].
    past_contact : bool
        Whether the smooth energy is followed beyond contact and unloading.

    Returns
    -------
    tuple
        Parts (dicts of columns), events (kind, row, numbers), the kind of end, and whether the
        path begins with upright bars.
    """
    level = min_height if min_height > 0 else -prism.height
    stop = ("flat", "height", "load", *(() if past_contact else ("contact",)))
    down, events = _branch(prism, numbers(prism, level, max_load), -1, stop)
    parts, rows, upright = [_columns(prism, down)], 0, False
    if max_height is not None:
        goes_slack = not past_contact and not math.isinf(prism.k_base)
        stop = ("height", *(("unloaded",) if goes_slack else ()))
        up, above = _branch(prism, numbers(prism, max_height), 1, stop)
        tension = {name: column[:0:-1] for name, column in _columns(prism, up).items()}
        parts, rows = [tension, *parts], len(up) - 1
        above = [(kind, max(rows - 1 - row, 0), at) for kind, row, at in above[::-1] if row > 0]
        if up.end == "unloaded":
            upright_rows = _upright(prism, max_height, tension)
            parts, rows = [upright_rows, *parts], rows + len(upright_rows["height"])
            upright = bool(upright_rows["height"][0] < max_height)
            above = [(kind, row + len(upright_rows["height"]), at) for kind, row, at in above]
        events = [*above, *((kind, row + rows, at) for kind, row, at in events)]
    return parts, events, down.end, upright


def _branch(
    prism: Prism, p: list[float], direction: int, stop: tuple[str, ...]
) -> tuple[Branch, list[LocatedEvent]]:
    """The branch in units of the problem, and its events (kind, row, numbers) in SI units."""
    of, start = problem(*kind_of(prism)), np.zeros(4 - kind_of(prism)[0])
    branch = trace(of, start, p, SETTINGS, direction, stop)
    branch.p = p
    kinds = {"contact": "contact", "unloaded": "slack"}
    kinds |= {kind: kind for kind in ("fold", "turn", "flat", "bifurcation")}
    if kind_of(prism)[0]:
        del kinds["unloaded"]  # rigid bases do not go slack
    events = []
    for event in branch.events:
        kind = kinds.get(event.kind)
        if event.row == 0 and event.kind in ("contact", "unloaded"):
            kind = "slack" if event.kind == "contact" else None  # no prestrain: slack at the start
        if kind:
            columns = {name: np.array([event.at[name]]) for name in STATE}
            at = {name: float(x[0]) for name, x in _in_si(prism, columns).items()}
            if kind == "flat":
                at |= FLAT
            events.append((kind, event.row, at))
    return branch, events


def _in_si(prism: Prism, columns: Mapping[str, Any]) -> Columns:
    force = prism.k_cross * prism.base
    return {
        "height": columns["height"] * prism.base,
        "twist": columns["twist"],
        "base": columns["base"] * prism.base,
        "load": columns["load"] * force,
    }


def _columns(prism: Prism, branch: Branch) -> Columns:
    by_load, by_height = stable(branch.z, branch.p, math.isinf(prism.k_base))
    columns = _in_si(prism, branch.columns)
    columns["load"][0] = 0.0  # the self-stressed state
    if branch.end == "flat":
        for name, value in FLAT.items():
            columns[name][-1] = value
    return columns | {"stable_load": by_load, "stable_height": by_height}


def _upright(prism: Prism, max_height: float, below: Columns) -> Columns:
    """Rows above the point where base strings and bars unload, in descending height.

    These are the upright states of `derivations.mixed`, which are stable because their energy is a
    sum of squares with positive weights.
    """
    cross, _, bar = prism.natural_lengths()
    height = np.linspace(below["height"][0], min(max_height, bar), ROWS + 1)[:0:-1]
    symbols = height, prism.k_cross, cross, bar
    twist, base_squared, load = run(derived(_upright_forms, prism.sides), np, symbols)
    true = np.ones(ROWS, dtype=bool)
    return {
        "height": height,
        "twist": np.full(ROWS, twist),
        "base": np.sqrt(np.maximum(base_squared, 0.0)),
        "load": load,
        "stable_load": true,
        "stable_height": true,
    }


def _upright_forms(sides: int) -> tuple[list[Any], tuple[Any, ...]]:
    """Twist, squared base and load as forms in height, k_cross and natural lengths of cross
    string and bar."""
    from derivations import mixed, prism, regular

    symbols = (prism.height, prism.k_cross, prism.natural_cross, prism.natural_bar)
    of = regular.TRIANGLE if sides == 3 else regular.ANY
    forms = mixed.upright_twist(of), mixed.upright_base_squared(of), mixed.upright_load(of)
    if sides != 3:
        import sympy as sp

        angle = sp.pi / sides
        known = {regular.half_angle: angle, regular.number_of_sides: sides}
        known |= {regular.half_sine: sp.sin(angle), regular.half_cosine: sp.cos(angle)}
        forms = tuple(form.subs(known).evalf(30) for form in forms)
    return list(forms), symbols
