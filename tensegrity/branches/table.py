"""Curves as tables: columns of equal length, and the events located on the curve."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self, overload

import numpy as np

from tensegrity import check, plotting
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed, drawn, filled
from tensegrity.typing import Array
from tensegrity.unit_names import unit_text

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.axes import Axes

INTERRUPTED = "interrupted"  # why a curve ends after Ctrl-C
FIRST = 6  # number of columns in the text of an event
ROUND_OFF = 1e-13  # of the largest value of a column: less is printed as 0


@dataclass(frozen=True)
class Event:
    """A located point of a branch; it has the columns of the table as attributes.

    Attributes
    ----------
    kind : str
    row : int
        The last row before the event, or at it.
    at : dict of str to float
        Value of each column at the event.
    note : str
        A description in words, or empty.
    units : dict of str to str
        Units of the columns, for printing.
    multiplicity : int
        Of a bifurcation: the dimension of the null space, less that of the path.
    """

    kind: str
    row: int
    at: dict[str, float] = field(repr=False)
    note: str = ""
    units: Mapping[str, str] = field(default_factory=dict, repr=False)
    multiplicity: int = field(default=1, repr=False)

    @property
    def value(self) -> float:
        """Value of the first column, that which is followed, at the event."""
        return next(iter(self.at.values()))

    def __getattr__(self, name: str) -> float:
        at = self.__dict__.get("at", {})  # missing while a copy is being made
        if name in at:
            return at[name]
        raise AttributeError(f"event has no {name!r}, only {', '.join(at)}")

    def __str__(self) -> str:
        first = list(self.at.items())[:FIRST]
        shown = [f"{k} {v:.6g} {self.units.get(k, '')}".rstrip() for k, v in first]
        more = f" and {len(self.at) - FIRST} more" if len(self.at) > FIRST else ""
        note = f"; {self.note}" if self.note else ""
        return filled(f"{self.kind}: {', '.join(shown)}{more}{note}")


class Table(Printed):
    """Columns of equal length along a curve, and the events on it.

    Columns are attributes; `table[3]` is a row as a dict, a slice is a table, and `len` is the
    number of rows.

    Attributes
    ----------
    columns : dict of str to ndarray, (rows,)
    events : tuple of Event
    end : str
        Why the curve ends there.
    """

    _by_row: tuple[str, ...] = ()  # further arrays with one entry per row
    _units: ClassVar[Mapping[str, str]] = {}  # of columns

    def __init__(
        self, columns: Mapping[str, Any], events: Iterable[Event], end: str, **about: Any
    ) -> None:
        self.events = tuple(replace(e, units=self._units) for e in events)
        self.columns, self.end = dict(columns), end
        self.__dict__.update(about, **{name: self.columns.pop(name) for name in self._by_row})

    def __getattr__(self, name: str) -> Any:
        columns = self.__dict__.get("columns", {})
        if name in columns:
            return columns[name]
        raise AttributeError(f"no column {name!r}, only {', '.join(columns)}")

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    @overload
    def __getitem__(self, key: slice) -> Self: ...
    @overload
    def __getitem__(self, key: int) -> dict[str, Any]: ...
    def __getitem__(self, key: int | slice) -> Self | dict[str, Any]:
        if not isinstance(key, slice):
            row = {name: column[key] for name, column in self.columns.items()}
            return {k: x.item() if isinstance(x, np.generic) else x for k, x in row.items()}
        rows = range(len(self))[key]
        new_row = {row: number for number, row in enumerate(rows)}
        part = object.__new__(type(self))
        part.__dict__.update(self.__dict__)
        part.__dict__.update((name, getattr(self, name)[key]) for name in self._by_row)
        part.columns = {name: column[key] for name, column in self.columns.items()}
        part.events = tuple(replace(e, row=new_row[e.row]) for e in self.events if e.row in new_row)
        if len(self) - 1 not in new_row:
            part.end = "end of the slice"
        return part

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[row] for row in range(len(self)))

    def _lines(self) -> Lines:
        first, last = (self._quantities(self[row], self.columns) for row in (0, len(self) - 1))
        yield f"{len(self)} rows"
        yield from (f"  from {first}", *(f"  {e}" for e in self.events), f"  to {last}")
        yield f"  ends: {self.end}"

    def __repr__(self) -> str:
        kinds = ", ".join(e.kind for e in self.events) or "no events"
        return filled(f"{type(self).__name__}({len(self)} rows; {kinds})")

    _draw = drawn

    def _quantities(self, values: Mapping[str, Any], names: Iterable[str]) -> str:
        """Values of columns in words, with their units; what is round-off of its column is 0."""
        sizes = {n: np.abs(self.columns[n], dtype=float) for n in names}
        least = {n: ROUND_OFF * x.max(initial=0, where=np.isfinite(x)) for n, x in sizes.items()}
        shown = {n: 0.0 if abs(values[n]) < least[n] else values[n] for n in least}
        return ", ".join(f"{n} {x:.6g} {self._units.get(n, '')}".rstrip() for n, x in shown.items())

    def _heading(self, name: str) -> str:
        """What a column holds, and its unit."""
        unit = unit_text(self._units.get(name, ""))
        return f"{name} [{unit}]" if unit else name

    def to_dataframe(self) -> Any:
        """The columns as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each point, with the columns under their names; `attrs` has "headings", what
            each column holds with its unit, "events", one dict for each with its kind and row, and
            "end".

        Raises
        ------
        TensegrityError
            If pandas is not installed.
        """
        frame = check.package("pandas", "to_dataframe", "data").DataFrame(self.columns)
        frame.attrs["headings"] = {name: self._heading(name) for name in self.columns}
        frame.attrs["events"] = [{"kind": e.kind, "row": e.row, **e.at} for e in self.events]
        frame.attrs["end"] = self.end
        return frame

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the columns with 17 digits, below a line that names them and their units.

        Parameters
        ----------
        path : str or path
            A file that is there is replaced.

        Raises
        ------
        TensegrityError
            A path that names no file, or a file that cannot be written.
        """
        table = np.column_stack([np.asarray(c, dtype=float) for c in self.columns.values()])
        header = ",".join(map(self._heading, self.columns))
        path = check.path("path", path)
        with check.replacing(path) as new:
            np.savetxt(new, table, fmt="%.17g", delimiter=",", header=header, comments="")

    def plot(self, ax: Axes | None = None, *, x: str | None = None, y: str | None = None) -> Axes:
        """Draw one column against another, with the events marked, and dashed where a column
        "stable" says that it is not.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.
        x, y : str, optional
            Names of columns; by default the load against the shortening where there are both, else
            the second column against the first.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or a name is not that of a column.
        """
        usual = [name if name in self.columns else "" for name in ("shortening", "load")]
        usual = usual if all(usual) else list(self.columns)[:2]
        x, y = usual[0] if x is None else x, usual[1] if y is None else y
        for name in (x, y):
            if not isinstance(name, str) or name not in self.columns:
                raise TensegrityError(
                    f"column {check.shown(name)} is not one of {', '.join(self.columns)}"
                )
        drawn: Axes = plotting.axes(ax)
        unstable = ~np.asarray(self.columns.get("stable", np.ones(len(self))), dtype=bool)
        near = unstable | np.append(unstable[1:], False) | np.insert(unstable[:-1], 0, False)
        line = drawn.plot(
            self.columns[x], np.where(unstable, np.nan, self.columns[y]), "-", lw=1.5
        )[0]  # fmt: skip
        if unstable.any():
            part, color = np.where(near, self.columns[y], np.nan), line.get_color()
            drawn.plot(self.columns[x], part, "--", color=color, lw=1.5, label="unstable")
        for kind in dict.fromkeys(e.kind for e in self.events):
            shown = [e.at for e in self.events if e.kind == kind]
            drawn.plot([e[x] for e in shown], [e[y] for e in shown], "o", ms=5, label=kind)
        if self.events or unstable.any():
            drawn.legend(frameon=False)
        signs = {"load": ", compression > 0"}
        labels = [self._heading(name) + signs.get(name, "") for name in (x, y)]
        drawn.set(xlabel=labels[0], ylabel=labels[1])
        return drawn


class Branch(Table):
    """A traced branch: a table of unknowns and columns, with tangents and residuals.

    Attributes
    ----------
    z, tangent : ndarray, (rows, m)
        Unknowns, and unit tangents in scaled unknowns.
    arc : ndarray, (rows,)
        Arc length from the start of the branch, in scaled unknowns.
    residual : ndarray, (rows,)
        Largest scaled residual.
    """

    z: Array
    tangent: Array
    arc: Array
    residual: Array
    _by_row = ("z", "tangent", "arc", "residual")
