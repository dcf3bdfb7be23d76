"""Where the beads and walls of a guide are, as plain arrays, and which of them touch."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import TensegrityError
from tensegrity.readonly import ReadOnly, fixed

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Indices

TOUCH = 1e-9  # of a diameter: closer than this, beads that should touch do
NEAR = 0.2  # diameters: a bead so near to a bevel may touch it during a run


@dataclass(frozen=True)
class Piece:
    """A flat piece of wall.

    Attributes
    ----------
    start, end : tuple of float, (2,)
        Its edges [m]; beads are on its left, seen from `start` to `end`.
    name : str
    """

    start: tuple[float, float]
    end: tuple[float, float]
    name: str

    @classmethod
    def between(cls, start: Array, end: Array, name: str) -> Piece:
        """That with its edges in these places, (2,) each [m]."""
        (a, b), (c, d) = start.tolist(), end.tolist()
        return cls((a, b), (c, d), name)

    @property
    def is_bevel(self) -> bool:
        """Whether it stands across the edge between two others."""
        return self.name.endswith("bevel")

    @property
    def length(self) -> float:
        """[m]."""
        return math.dist(self.start, self.end)

    @property
    def along(self) -> Array:
        """Unit vector from `start` to `end`, (2,)."""
        return np.subtract(self.end, self.start) / self.length

    @property
    def normal(self) -> Array:
        """Unit vector towards the beads, (2,)."""
        x, y = self.along
        return np.array([-y, x])

    def place(self, position: ArrayLike) -> tuple[Array, Array]:
        """Distance from the plane and place along it, from `start` [m]; (..., 2) -> two (...)."""
        away = np.asarray(position) - self.start
        return away @ self.normal, away @ self.along


@dataclass(frozen=True, eq=False)
class Layout(ReadOnly):
    """Where beads and walls are.

    Attributes
    ----------
    diameter : float
        Of all beads [m].
    positions : ndarray, (beads, 2)
        Centres at rest [m].
    parts : dict of str to tuple of int
        Beads of each part, in the paper's counting order.
    gap : float
        Of all beads to their side walls at rest [m].
    walls : tuple of Piece
    blind : bool
        Beads of different branches pass through each other: an idealisation, to be compared.
    """

    diameter: float
    positions: Array
    parts: dict[str, tuple[int, ...]]
    gap: float = 0.0
    walls: tuple[Piece, ...] = ()
    blind: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", fixed(self.positions))
        object.__setattr__(self, "parts", fixed(self.parts))

    def contacts(self) -> Indices:
        """Pairs of beads that touch, each once and the lower first; (contacts, 2)."""
        pairs, distance = self._pairs()
        return pairs[distance <= self.diameter * (1 + TOUCH)]

    def _pairs(self) -> tuple[Indices, Array]:
        """Pairs of beads that can meet, and their distances."""
        x = self.positions
        i, j = np.triu_indices(len(x), 1)
        if self.blind:
            branch = np.zeros(len(x), dtype=int)
            for name, beads in self.parts.items():
                if name.startswith("branch"):
                    branch[list(beads)] = int(name[-1])
            seen = branch[i] * branch[j] != 2
            i, j = i[seen], j[seen]
        return np.stack([i, j], axis=1), np.linalg.norm(x[i] - x[j], axis=1)

    def wall_contacts(self) -> Indices:
        """(bead, wall) that touch, would without the gap, or may; (contacts, 2)."""
        found = []
        for number, wall in enumerate(self.walls):
            room = NEAR if wall.is_bevel else TOUCH
            reach = self.diameter * (0.5 + room) + self.gap
            distance, along = wall.place(self.positions)
            beside = (along >= 0) & (along <= wall.length) & (abs(distance) <= reach)
            found += [(int(bead), number) for bead in np.flatnonzero(beside)]
        return np.array(sorted(found), dtype=int).reshape(-1, 2)

    def wall_gaps(self) -> Array:
        """Gap of each wall contact at rest [m]; (contacts,)."""

        def gap(bead: int, wall: Piece) -> Any:
            if wall.is_bevel:
                return wall.place(self.positions[bead])[0] - self.diameter / 2
            return self.gap if wall.name.endswith("wall") else 0.0

        return np.array([gap(bead, self.walls[wall]) for bead, wall in self.wall_contacts()])

    def check(self) -> None:
        """Refuse overlapping beads, and beads that reach through a wall."""
        pairs, distance = self._pairs()
        closest = int(np.argmin(distance))
        if distance[closest] < self.diameter * (1 - TOUCH):
            one, other = (self.name(b) for b in pairs[closest])
            raise TensegrityError(
                f"{one} and {other} overlap by {self.diameter - distance[closest]:.3g} m at rest, "
                f"with a distance of {distance[closest]:.6g} m and diameters of "
                f"{self.diameter:.6g} m"
            )
        for wall in self.walls:
            away, along = wall.place(self.positions)
            beside = (along >= 0) & (along <= wall.length) & (abs(away) < self.diameter / 2)
            depth = np.where(beside, self.diameter / 2 - away, 0.0)
            worst = int(np.argmax(depth))
            if depth[worst] > TOUCH * self.diameter:
                raise TensegrityError(
                    f"{self.name(worst)} is outside its guide: {depth[worst]:.3g} m beyond "
                    f"the {wall.name}, at most {TOUCH * self.diameter:.1g} m is allowed"
                )

    def name(self, bead: int) -> str:
        """Words for a bead: its part and its number in it, from 1."""
        for part, beads in self.parts.items():
            if bead in beads:
                return f"bead {beads.index(bead) + 1} of {part}"
        raise TensegrityError(f"bead {bead} must be below {len(self.positions)}")

    def stopped(self, parts: Iterable[str]) -> Layout:
        """The same with a plane wall behind the last bead of each of these parts."""
        ends = []
        for part in parts:
            before, last = self.positions[list(self.parts[part][-2:])]
            ahead = (last - before) / self.diameter
            centre, side = last + ahead * self.diameter / 2, np.array([-ahead[1], ahead[0]])
            edges = centre - side * self.diameter, centre + side * self.diameter
            ends.append(Piece.between(*edges, f"end of {part}"))
        return replace(self, walls=(*self.walls, *ends))
