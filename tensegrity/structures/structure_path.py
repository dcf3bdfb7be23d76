"""The equilibrium path of a structure as a table."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from tensegrity.branches.table import Table
from tensegrity.frames import Frames
from tensegrity.printing import Lines, listed, span
from tensegrity.structures.member_frames import of_members
from tensegrity.typing import Array, Flags
from tensegrity.unit_names import in_units


class StructurePath(Table):
    """Equilibria of a structure as a table.

    Attributes
    ----------
    shortening, load : ndarray, (rows,)
        Displacement conjugate to the load [m] and total load [N], compression > 0.  Paths of
        `control_path` have the column `control` from 0 to 1 instead.
    stable_load, stable_height : ndarray of bool, (rows,)
        Whether the tangent stiffness has no negative eigenvalue over the motions that the supports
        permit: under given (dead) load, and under given shortening; on paths of `control_path`
        both under given natural lengths.  A motion without stiffness counts as stable here, but
        not for `Structure.is_stable`.
    tensions : ndarray, (rows, members)
        Tensions of the members [N]; as columns "tension 0" and so on.
    slack, buckled : ndarray of bool, (rows, members)
        Which members are slack strings, and buckled bars.
    positions : ndarray, (rows, nodes, dim)
        Positions of the nodes [m].
    events : tuple of Event
        Located points, with the columns as attributes.  The kinds are "slack" (strings go slack,
        or taut again, as the note says), "buckling" of bars, "kink" of a law, "fold" (limit point
        in load), "turn" (limit point in displacement), "bifurcation" with its `multiplicity`,
        "plate", "contact", and names of columns given in `at`.  Strings that reach their natural
        length at the same point make one event.
    structure : Structure
        The structure at the start of the path.
    winding : str
        What members keep whose natural lengths change: EA, or k.
    end : str
        Why the path ends.
    """

    load: Array
    shortening: Array
    stable_load: Flags
    stable_height: Flags
    positions: Array
    slack: Flags
    buckled: Flags
    structure: Any
    supports: Any
    winding: str
    _by_row = ("positions", "slack", "buckled")
    _units: ClassVar = {"shortening": "m", "load": "N", "work": "J"}

    @property
    def tensions(self) -> Array:
        """Tensions of the members [N], (rows, members)."""
        count = len(self.structure.ends)
        return np.column_stack([self.columns[f"tension {m}"] for m in range(count)])

    def frames(self) -> Frames:
        """Positions, and tension, force density and slackness of the members, at each row."""
        first = next(iter(self.columns))
        along, title = self._heading(first), repr(self.structure)
        at = self.columns[first], self.positions, self.tensions, self.slack
        return of_members(self.structure, title, along, *at)

    def _heading(self, name: str) -> str:
        """What a column holds, and its unit; a member's tension by the name of the member."""
        kind, _, number = name.partition(" ")
        if kind == "tension":
            return in_units(f"tension of {self.structure.name_of(int(number))} [N]")
        return super()._heading(name)

    def _lines(self) -> Lines:
        shown = [name for name in self.columns if not name.startswith("tension")]
        yield f"{self.structure!r}"
        yield f"  {len(self)} equilibria"
        for word, row in (("from", 0), ("to", -1)):
            yield f"  {word} {self._quantities(self[row], shown[:2])}"
            tension, slack = self.tensions[row], np.flatnonzero(self.slack[row])
            words = f"    tensions {span(tension, 'N')}, slack: {listed(slack)}"
            buckled = np.flatnonzero(self.buckled[row])
            yield words + f", buckled: {listed(buckled)}" * bool(len(buckled))
        for event in self.events:
            yield f"  {event.kind} at {self._quantities(event.at, shown[:2])}"
            yield from [f"    {event.note}"] * bool(event.note)
        if "control" in self.columns:
            yield f"  {self.winding}"
        yield f"  ends: {self.end}"
