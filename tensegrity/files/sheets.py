"""Structures and lattices as two sheets of nodes and members, NAME.nodes.csv and NAME.members.csv.

The first line of a sheet names its columns, with their units in brackets; columns are separated by
tabs, semicolons or commas, and where these are no commas, decimal commas are read.  Nodes and
members have any names.  A lattice has its vectors below the nodes, as nodes "vector 1" and so on.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.columns import NUMBER, PREFIXES, text_lines
from tensegrity.errors import TensegrityError
from tensegrity.lattices.lattice import Lattice
from tensegrity.structures.structure import Structure
from tensegrity.unit_names import unit_text

NODES = {"node": "", "x": "m", "y": "m", "z": "m", "mass": "kg"}
MEMBERS = {
    "member": "", "kind": "", "from": "", "to": "", "over": "", "offset 1": "", "offset 2": "",
    "offset 3": "", "k": "N/m", "ea": "N", "natural length": "m", "mass": "kg",
    "buckling load": "N", "length": "m", "tension": "N",
}  # fmt: skip
KINDS = {"bar": "bar", "strut": "bar", "string": "string", "cable": "string"}
OTHERS = {"m": {"in": 0.0254, "ft": 0.3048}, "N": {"lbf": 4.4482216152605}, "kg": {"t": 1e3}}
HEADING = re.compile(r"([^\[(]*?)\s*(?:[\[(](.*)[\])])?\s*")
VECTOR = re.compile(r"vector [1-3]")


def _factor(unit: str, base: str) -> float | None:
    """What a value in a unit is multiplied by; None of one that is none of this quantity."""
    if unit == unit_text(base):
        return 1.0
    factor, parts = 1.0, (unit.split("/"), base.split("/"))
    if not base or len(parts[0]) != len(parts[1]):
        return None
    for power, (one, of) in zip((1, -1), zip(*parts, strict=True), strict=False):
        si, gram = ("g", 1e-3) if of == "kg" else (of, 1.0)
        known = {
            prefix + si: gram * 10.0**k for prefix, k in {**PREFIXES, "G": 9}.items()
        } | OTHERS[of]
        if one not in known:
            return None
        factor *= known[one] ** power
    return factor


@dataclass(frozen=True)
class Field:
    """One field of a sheet, for messages."""

    text: str
    where: str
    comma: bool = False

    def refuse(self, words: str) -> TensegrityError:
        """The error that names the place, what stands there, and what is wrong."""
        return TensegrityError(f"{self.where}: {check.shown(self.text)} {words}")

    def number(self) -> float:
        """The number, without its unit."""
        read = NUMBER.fullmatch(self.text) and (self.comma or "," not in self.text)
        value = float(self.text.replace(",", ".")) if read else np.nan
        if not np.isfinite(value):
            raise self.refuse("is no finite number")
        return value


class Sheet:
    """A table of text, each field with its place.

    Parameters
    ----------
    path : Path
    known : dict of str to str
        Names of columns and the units of SI that their values get.
    needed : sequence of str
        Columns that must be there.
    """

    def __init__(self, path: Path, known: dict[str, str], needed: Sequence[str]) -> None:
        path, text = text_lines(path)
        first = next((line for line in text if line.strip()), "")
        mark = next((one for one in "\t;," if one in first), ",")
        reader = csv.reader(text, delimiter=mark, skipinitialspace=True)
        try:
            lines = [(reader.line_num, row) for row in reader if any(x.strip() for x in row)]
        except csv.Error as error:
            raise TensegrityError(f"{path}, line {reader.line_num}: {error}") from None
        if not lines:
            raise TensegrityError(f"{path} is empty")
        self.columns: dict[str, int] = {}
        self.factors: dict[str, float] = {}
        for place, label in enumerate(lines[0][1]):
            self._add_column(Field(label, f"{path}, line {lines[0][0]}, column {place + 1}"), known)
        missing = [name for name in needed if name not in self.columns]
        if missing:
            raise TensegrityError(f"{path}, line {lines[0][0]}: no column {missing[0]!r}")
        width = len(lines[0][1])
        self.rows: list[dict[str, Field]] = []
        for number, row in lines[1:]:
            if len(row) != width:
                raise TensegrityError(
                    f"{path}, line {number}: {len(row)} columns, must be {width} as in line "
                    f"{lines[0][0]}"
                )
            where = f"{path}, line {number}, column"
            self.rows.append({
                name: Field(row[place].strip(), f"{where} {name!r}", mark != ",")
                for name, place in self.columns.items()
            })  # fmt: skip

    def _add_column(self, label: Field, known: dict[str, str]) -> None:
        found = HEADING.fullmatch(label.text.strip())
        name, unit = (found[1].lower(), found[2]) if found else ("", None)
        if name not in known:
            raise label.refuse(f"must be one of {', '.join(known)}, and a unit in brackets")
        if name in self.columns:
            raise label.refuse("is there twice")
        factor = 1.0 if unit is None else _factor(unit.strip(), known[name])
        if factor is None:
            raise label.refuse(f"has an unknown unit, must be of {known[name] or 'no unit'}")
        others = [one for one in "xyz" if one in self.columns and name in tuple("xyz")]
        if others and self.factors[others[0]] != factor:
            raise label.refuse(f"has another unit than {others[0]}: give all coordinates in one")
        self.columns[name], self.factors[name] = len(self.columns), factor

    def named(self, column: str) -> dict[str, int]:
        """Numbers of the rows by the names in a column, which must differ."""
        found: dict[str, int] = {}
        for number, row in enumerate(self.rows):
            if row[column].text in found:
                raise row[column].refuse("is there twice")
            found[row[column].text] = number
        return found

    def numbers(
        self, column: str, rows: Sequence[dict[str, Field]], least: float | None = None
    ) -> Any:
        """Values of a column in SI.

        Parameters
        ----------
        column : str
        rows : sequence of dict
        least : float, optional
            Values must be above it; by default at least 0.

        Returns
        -------
        ndarray, (rows,), or None
            None where the column is not there, or empty in all of the rows.

        Raises
        ------
        TensegrityError
        """
        if column not in self.columns or not any(row[column].text for row in rows):
            return None
        values = [row[column].number() for row in rows]
        for value, row in zip(values, rows, strict=True):
            if not (value >= 0 if least is None else value > least):
                bound = "at least 0" if least is None else f"above {least:g}"
                raise row[column].refuse(f"must be {bound}")
        return np.array(values) * self.factors[column]


def sheets(path: Path) -> tuple[Path, Path]:
    """The files of nodes and of members, from their common name or either of them."""
    stem = path.name
    for end in (".csv", ".nodes", ".members"):
        stem = stem.removesuffix(end)
    return path.with_name(f"{stem}.nodes.csv"), path.with_name(f"{stem}.members.csv")


def read_sheets(path: Path) -> Structure | Lattice:
    """The structure or lattice of two sheets; see `tensegrity.files.read`."""
    of_nodes, of_members = sheets(path)
    nodes = Sheet(of_nodes, NODES, ("node", "x", "y"))
    members = Sheet(of_members, MEMBERS, ("kind", "from", "to"))
    names, axes = nodes.named("node"), [axis for axis in "xyz" if axis in nodes.columns]
    if "member" in members.columns:
        members.named("member")
    if not nodes.rows:
        raise TensegrityError(f"{of_nodes}: 0 nodes")
    places = np.stack([nodes.numbers(axis, nodes.rows, -np.inf) for axis in axes], axis=1)
    periods = [k for name, k in names.items() if VECTOR.fullmatch(name)]
    own = [k for k in range(len(nodes.rows)) if k not in periods]
    number = {name: own.index(k) for name, k in names.items() if k in own}

    def node(cell: Field, text: str) -> int:
        if text not in number:
            raise cell.refuse(f"names no node of {of_nodes.name}")
        return number[text]

    parts = _members(members, node, len(periods))
    parts["mass"] = nodes.numbers("mass", [nodes.rows[k] for k in own])
    try:
        if periods:
            parts.pop("cables")
            return Lattice(places[own], places[periods], **parts)
        return Structure(places, **parts)
    except TensegrityError as error:
        raise TensegrityError(f"{of_nodes} and {of_members.name}: {error}") from None


def _members(sheet: Sheet, node: Callable[[Field, str], int], d: int) -> dict[str, Any]:
    """Arguments of a structure, from the rows of its members; bars first, cables last."""
    groups: dict[str, list[Any]] = {"bar": [], "string": [], "cable": []}
    for row in sheet.rows:
        kind, path = _member(row, node, d)
        groups[kind].append((row, path))
    paths = {f"{kind}s": [path for _, path in group] for kind, group in groups.items()}
    bars, strings, cables = ([row for row, _ in group] for group in groups.values())
    numbers = sheet.numbers
    return paths | {
        "k_bar": numbers("k", bars, 0.0), "EA_bar": numbers("ea", bars, 0.0),
        "k_string": numbers("k", strings + cables, 0.0),
        "EA_string": numbers("ea", strings + cables, 0.0),
        "bar_mass": numbers("mass", bars), "string_mass": numbers("mass", strings),
        "natural_lengths": numbers("natural length", bars + strings + cables, 0.0),
        "buckling": numbers("buckling load", bars, 0.0),
    }  # fmt: skip


def _member(
    row: dict[str, Field], node: Callable[[Field, str], int], d: int
) -> tuple[str, tuple[Any, ...]]:
    """The kind of a member, and its nodes, in a lattice of d vectors with the offset."""
    kind = KINDS.get(row["kind"].text.lower())
    if kind is None:
        raise row["kind"].refuse(f"must be one of {', '.join(KINDS)}")
    over = row["over"].text.split() if "over" in row else []
    if over and (kind == "bar" or d):
        raise row["over"].refuse("is there for cables of structures alone")
    first, last = (node(row[end], row[end].text) for end in ("from", "to"))
    path: tuple[Any, ...] = (first, *(node(row["over"], name) for name in over), last)
    names = [f"offset {k + 1}" for k in range(d)]
    if d and not set(names) <= row.keys():
        raise row["kind"].refuse(f"has no columns {', '.join(names)}, as there are {d} vectors")
    offset = [row[name].number() for name in names]
    whole = tuple(int(x) if x == int(x) else x for x in offset)
    return "cable" if over else kind, (*path, whole) if d else path


@checked
def write_sheets(
    path: Path, shape: Structure | Lattice, *, separator: Annotated[str, (",", ";", "\t")] = ","
) -> None:
    """Both sheets of a structure or lattice, numbers with all digits.

    Parameters
    ----------
    path : Path
    shape : Structure or Lattice
    separator : {",", ";", "\\t"}, optional
        Of columns; but for "," decimal commas are written.

    Raises
    ------
    TensegrityError
        Laws of members, platforms and plateaus, which a sheet does not hold.
    """
    held = {
        "law": shape.law,
        "platforms": getattr(shape, "platforms", ()),
        "plateau": shape.plateau,
    }
    for name, given in held.items():
        if given:
            raise TensegrityError(f"{name} of the structure: a sheet of members does not hold it")
    of_nodes, of_members = sheets(path)
    vectors = getattr(shape, "vectors", np.zeros((0, shape.dim)))
    names = [*range(shape.nodes), *(f"vector {k + 1}" for k in range(len(vectors)))]
    nodes: dict[str, Any] = {"node": names}
    nodes |= dict(zip("xyz", np.vstack([shape.positions, vectors]).T, strict=False))
    nodes["mass"] = [*shape.mass, *[""] * len(vectors)]
    bars, direct = shape.bars, len(shape.ends) - len(shape.cables)
    members: dict[str, Any] = {"member": range(len(shape.ends))}
    members["kind"] = ["bar"] * bars + ["string"] * (direct - bars) + ["cable"] * len(shape.cables)
    members |= dict(zip(("from", "to"), shape.ends.T, strict=True))
    if shape.cables:
        over = [" ".join(map(str, cable[1:-1])) for cable in shape.cables]
        members["over"] = [""] * direct + over
    for k, offset in enumerate(getattr(shape, "offsets", np.zeros((0, 0))).T):
        members[f"offset {k + 1}"] = offset
    kept = shape.keeps_EA
    members["k"] = ["" if own else k for own, k in zip(kept, shape.stiffnesses, strict=True)]
    members["EA"] = [axial if own else "" for own, axial in zip(kept, shape.EA, strict=True)]
    members["natural length"] = shape.natural_lengths
    if shape.has_heavy_members:
        members["mass"] = shape.member_mass
    if shape.buckling is not None:
        members["buckling load"] = [*shape.buckling, *[""] * (len(shape.ends) - bars)]
    members |= {"length": shape.lengths, "tension": shape.tensions}
    for file, columns, units in ((of_nodes, nodes, NODES), (of_members, members, MEMBERS)):
        labels = [_label(name, units[name.lower()]) for name in columns]
        lines = zip(*(map(_text, values) for values in columns.values()), strict=True)
        with check.replacing(file) as new, open(new, "w", encoding="utf-8", newline="") as out:
            writer = csv.writer(out, delimiter=separator, lineterminator="\n")
            writer.writerow(labels)
            for line in lines:
                writer.writerow(x if separator == "," else x.replace(".", ",") for x in line)


def _label(name: str, unit: str) -> str:
    unit = unit_text(unit)
    return f"{name} [{unit}]" if unit else name


def _text(value: Any) -> str:
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)
