"""The loops of an `Ensemble`: as many lanes at once as one compiled loop takes, then one by one."""

from __future__ import annotations

import math
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import kernel
from tensegrity.engine.bonds import Bonds, by_spring
from tensegrity.engine.walk import Part

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.methods import Method
    from tensegrity.typing import Array

TOGETHER = (64, 48, 32, 24, 16, 8)  # lanes that one compiled loop takes
MANY, MOST = 32, 1024  # and multiples of, at most


def bound(ensemble: Any, u: Array, v: Array, method: Method, dt: float) -> Any:
    """One loop over all lanes, where one is compiled for so many, or `Lanes`."""
    fit = filled(ensemble.lanes) == ensemble.lanes <= MOST
    bonds = _side_by_side(ensemble, method) if fit else None
    if bonds is None:
        return Lanes(ensemble, u, v, method, dt)
    return kernel.bind(u, v, bonds(slice(None)), method, dt)


def filled(lanes: int) -> int:
    """The least number of lanes, not below this, that one compiled loop takes; as many beyond."""
    if lanes == 1 or lanes > MOST:
        return lanes
    return min((n for n in TOGETHER if n >= lanes), default=MANY * math.ceil(lanes / MANY))


class Lanes:
    """Lanes in one loop, or in groups of `MOST`, the last filled with copies of its last one; or,
    where there is no such loop, one by one.  The last bit of a lane depends on the loop: it is
    that of `Ensemble.filled`."""

    def __init__(self, ensemble: Any, u: Array, v: Array, method: Method, dt: float) -> None:
        self._whole, self._groups = (u, v), []
        self._springs = len(ensemble.spring_table)
        bonds, lane = _side_by_side(ensemble, method), 0
        while lane < ensemble.lanes:
            width = min(filled(ensemble.lanes - lane), MOST) if bonds else 1
            lanes = np.minimum(np.arange(lane, lane + width), ensemble.lanes - 1)
            part = np.s_[..., lanes] if bonds else np.s_[..., lane]
            arrays = np.ascontiguousarray(u[part]), np.ascontiguousarray(v[part])
            if bonds:
                loop = kernel.bind(*arrays, bonds(lanes), method, dt)
                place = np.arange(self._springs)
            else:
                scene = ensemble.scenes[lane]
                loop = scene.bind(*arrays, method, dt)
                place = ensemble.places_of(lane)
            self._groups.append((part, arrays, loop, place))
            lane += width

    def forget_range(self) -> None:
        """Start anew to record elongations and the way travelled."""
        for _, _, loop, _ in self._groups:
            loop.forget_range()

    @property
    def range(self) -> Array:
        """Smallest and largest elongation of each different spring since `forget_range`."""
        places = np.concatenate([place for *_, place in self._groups])
        met = np.concatenate([loop.range for _, _, loop, _ in self._groups])
        return by_spring(places, self._springs, *met.T)

    def show(self, u: Array, v: Array) -> Any:
        """What makes copies of u and v what is looked at; None where they are that already."""
        shown, groups = copy(self), []
        for part, _, loop, place in self._groups:
            arrays = np.ascontiguousarray(u[part]), np.ascontiguousarray(v[part])
            groups.append((part, arrays, loop.show(*arrays), place))
        shown._whole, shown._groups = (u, v), groups
        return None if any(loop is None for _, _, loop, _ in groups) else shown

    @property
    def parts(self) -> Any:
        """Those of all groups, as `walk` takes them; None where one has none."""
        each: Any = [(part, getattr(loop, "parts", None)) for part, _, loop, _ in self._groups]
        if any(parts is None for _, parts in each):
            return None
        return lambda: [
            Part(place, one.call[0], one.call[1], one.u, one.v, one.begins)
            for place, parts in each
            for one in parts()
        ]

    @property
    def travel(self) -> float:
        """Bound on how far any coordinate of a site moved since then [m]."""
        return max(loop.travel for _, _, loop, _ in self._groups)

    def begin(self) -> None:
        """Say that the next step is the first of a run."""
        for _, _, loop, _ in self._groups:
            loop.begin()

    def stand_alone(self) -> None:
        """Say that steps have none before them and none behind."""
        for _, _, loop, _ in self._groups:
            loop.stand_alone()

    def advance(self, steps: int) -> None:
        """Advance u and v by whole steps."""
        for part, arrays, loop, _ in self._groups:
            for own, whole in zip(arrays, self._whole, strict=True):
                own[...] = whole[part]
            loop.advance(steps)
            for own, whole in zip(arrays, self._whole, strict=True):
                whole[part] = own


def _side_by_side(ensemble: Any, method: Method) -> Any:
    """A function lanes -> bonds for a loop over so many; None where the lanes must run in turn."""
    parts = [scene.loop_bonds for scene in ensemble.scenes]
    if not method.explicit or any(part.contacts is not None for part in parts):
        return None
    laws, law, parameters = ensemble.spring_table.table
    group = ensemble.spring_table.group
    if group.ndim == 2 and np.any(law[group] != law[group[:, :1]]):
        return None
    weights = ensemble.inverse_mass

    def bonds(lanes: Any) -> Bonds:
        mine = group if group.ndim == 1 else group[:, lanes]
        mass = np.ascontiguousarray(weights[:, lanes])
        return Bonds(laws, law, parameters, mine, mass, openings=ensemble.spring_table.openings)

    return bonds


class Clearances:
    """Those of all lanes, each with its own, as if they were one."""

    def __init__(self, each: Any) -> None:
        self._each = each

    def tracker(self, u: Array) -> _Trackers:
        """A watch over all lanes that starts at displacements u."""
        trackers = [one.tracker(u[..., k]) for k, one in enumerate(self._each)]
        return _Trackers(trackers)


class _Trackers:
    def __init__(self, each: Any) -> None:
        self._each = each

    def share(self, travel: float) -> float:
        """As `clearance.Tracker`, the largest of all lanes."""
        return max(one.share(travel) for one in self._each)

    def accept(self, u: Array, travel: float) -> None:
        """As `clearance.Tracker`."""
        for lane, one in enumerate(self._each):
            one.accept(u[..., lane], travel)

    def is_new(self) -> bool:
        """As `clearance.Tracker`: lists of lanes are never made anew."""
        return False

    def judge(self, u: Array, t: float) -> None:
        """As `clearance.Tracker`."""
        for lane, one in enumerate(self._each):
            one.judge(u[..., lane], t)
