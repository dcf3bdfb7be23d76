"""The equilibrium path of a structure as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.table import Event, Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

    from matplotlib.axes import Axes

    from tensegrity.structures.structure import Structure
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags

LABELS = {
    "shortening": "shortening [m]",
    "load": "load [N], compression > 0",
    "control": "control",
}


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
    slack : ndarray of bool, (rows, members)
        Which members are slack strings.
    positions : ndarray, (rows, nodes, dim)
        Positions of the nodes [m].
    events : tuple of Event
        Located points, with the columns as attributes.  The kinds are "slack" (strings go slack,
        or taut again, as the note says), "fold" (limit point in load), "turn" (limit point in
        displacement), "bifurcation", "plate" and "contact".  Strings that reach their natural
        length at the same point make one event.
    structure : Structure
        The structure at the start of the path.
    end : str
        Why the path ends.
    """

    load: Array
    shortening: Array
    stable_load: Flags
    stable_height: Flags
    positions: Array
    slack: Flags
    _by_row = ("positions", "slack")

    def __init__(
        self,
        structure: Structure,
        columns: Mapping[str, Any],
        events: Iterable[Event],
        end: str,
        positions: Array,
        slack: Flags,
        supports: Supports | None,
    ) -> None:
        super().__init__(columns, events, end)
        self.structure, self.positions, self.slack = structure, positions, slack
        self.supports = supports

    @property
    def tensions(self) -> Array:
        """Tensions of the members [N], (rows, members)."""
        count = len(self.structure.ends)
        return np.column_stack([self.columns[f"tension {m}"] for m in range(count)])

    def __str__(self) -> str:
        shown = [name for name in self.columns if not name.startswith("tension")]
        lines = [f"{self.structure}", f"  {len(self)} equilibria"]
        for word, row in (("from", self[0]), ("to", self[-1])):
            lines.append(f"  {word} " + ", ".join(f"{n} {row[n]:.6g}" for n in shown[:2]))
        for event in self.events:
            note = event.note and f": {event.note}"
            at = ", ".join(f"{name} {event.at[name]:.6g}" for name in shown[:2])
            lines.append(f"  {event.kind} at {at}{note}")
        return "\n".join([*lines, f"  ends: {self.end}"])

    def plot(  # type: ignore[override]
        self, x: str | None = None, y: str | None = None, axes: Axes | None = None
    ) -> Axes:
        """Draw one column against another, with the events marked.

        Parameters
        ----------
        x, y : str, optional
            Names of columns; by default the first two.
        axes : matplotlib.axes.Axes, optional
            Axes to draw on; new ones by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        first, second = list(self.columns)[:2]
        return super().plot(first if x is None else x, second if y is None else y, axes, LABELS)

    def _draw(self, axes: Axes) -> Axes:
        return self.plot(axes=axes)
