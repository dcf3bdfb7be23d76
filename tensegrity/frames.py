"""Places of nodes at some instants, and the members between them: what is drawn, and what programs
for pictures read.  Structures, lattices, modes, paths and runs have `frames`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from tensegrity.typing import Array, Flags, Indices


@dataclass(frozen=True, eq=False)
class Frames:
    """A thing in motion, or at one instant.

    Attributes
    ----------
    title : str
    along : str
        What tells the instants apart, and its unit: "time [s]", "load [N]".
    at : ndarray, (instants,)
        Its values.
    places : ndarray, (instants, nodes, dim)
        [m].
    ends : ndarray of int, (segments, 2)
        Nodes that are joined; cables over nodes have several segments.
    is_string : ndarray of bool, (segments,)
    of_segments : dict of str to ndarray, (instants, segments)
        Values by their name and unit, such as "tension [N]"; tension > 0.
    of_nodes : dict of str to ndarray, (instants, nodes) or (instants, nodes, dim)
    radius : ndarray, (nodes,), or None
        [m].
    """

    title: str
    along: str
    at: Array
    places: Array
    ends: Indices
    is_string: Flags
    of_segments: dict[str, Any] = field(default_factory=dict)
    of_nodes: dict[str, Any] = field(default_factory=dict)
    radius: Array | None = None

    def __len__(self) -> int:
        return len(self.at)

    def rows(self, which: Any) -> Frames:
        """The same at some of the instants, by a slice or their numbers."""
        segments, nodes = (
            {name: values[which] for name, values in of.items()}
            for of in (self.of_segments, self.of_nodes)
        )
        at, places = self.at[which], self.places[which]
        return replace(self, at=at, places=places, of_segments=segments, of_nodes=nodes)
