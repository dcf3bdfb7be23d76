"""Places and members as files of programs for pictures, drawings, printing and beads.

Sources of the formats: VTK file formats (kitware), PolyData, inline and in base64, a block its size
and its bytes, each encoded; DXF reference of release 12; LAMMPS, command dump.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.frames import Frames
from tensegrity.typing import Array, Indices, Positive
from tensegrity.unit_names import in_units

KINDS = {np.dtype("f8"): "Float64", np.dtype("i8"): "Int64", np.dtype("u1"): "UInt8"}
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def one(frames: Frames, row: int | None, suffix: str) -> Frames:
    """The instant that a file without time shows.

    Parameters
    ----------
    frames : Frames
    row : int or None
        Its number; None where there is one only.
    suffix : str
        For messages.

    Returns
    -------
    Frames

    Raises
    ------
    TensegrityError
    """
    if row is None and len(frames) > 1:
        raise TensegrityError(f"{len(frames)} instants, a {suffix} shows one: give row=")
    number = check.whole("row", 0 if row is None else row, least=0, below=len(frames))
    return frames.rows([number])


def in_space(values: Array) -> Array:
    """Vectors (..., 1, 2 or 3) with three components."""
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, 3 - values.shape[-1])])


def vtp(path: Path, frames: Frames, *, row: int | None = None) -> None:
    """A file of VTK: lines with their values, and points with theirs; of one instant.

    Parameters
    ----------
    path : Path
    frames : Frames
    row : int, optional
        The instant, by its number.
    """
    _write(path, _poly_data(one(frames, row, ".vtp")))


def pvd(path: Path, frames: Frames) -> None:
    """A file that lists those of all instants, NAME.0000.vtp and so on, which it writes too."""
    names = [f"{path.stem}.{k:0{len(str(len(frames) - 1)):d}d}.vtp" for k in range(len(frames))]
    for k, name in enumerate(names):
        _write(path.with_name(name), _poly_data(frames.rows([k])))
    sets = "".join(
        f'<DataSet timestep="{float(at)!r}" file={quoteattr(name)}/>\n'
        for at, name in zip(frames.at, names, strict=True)
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0">\n<Collection>\n'
    _write(path, f"{head}{sets}</Collection>\n</VTKFile>\n")


def _poly_data(frames: Frames) -> str:
    """The text of a .vtp of the only instant."""
    of_points, of_cells = (
        "".join(_block(in_units(name), values[0], name) for name, values in of.items())
        for of in (frames.of_nodes, frames.of_segments)
    )
    if frames.radius is not None:
        of_points += _block(in_units("radius [m]"), frames.radius)
    kind = _block("string", frames.is_string)
    points = _block("points", in_space(frames.places[0]))
    count, ends = len(frames.ends), np.asarray(frames.ends, dtype="<i8")
    lines = _block("connectivity", ends.ravel()) + _block("offsets", 2 * np.arange(1, count + 1))
    return (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64">\n<PolyData>\n'
        f'<Piece NumberOfPoints="{frames.places.shape[1]}" NumberOfVerts="0" '
        f'NumberOfLines="{count}" NumberOfStrips="0" NumberOfPolys="0">\n'
        f"<PointData>\n{of_points}</PointData>\n<CellData>\n{of_cells}{kind}</CellData>\n"
        f"<Points>\n{points}</Points>\n<Lines>\n{lines}</Lines>\n"
        "</Piece>\n</PolyData>\n</VTKFile>\n"
    )


def _block(name: str, values: Any, vector: str = "") -> str:
    """One array as XML: numbers of points or cells in rows."""
    values = np.asarray(values)
    values = values.astype("u1") if values.dtype == bool else values
    values = in_space(values) if vector and values.ndim > 1 else values
    data = np.ascontiguousarray(values)
    size = np.array(data.nbytes, dtype="<u8")
    text = "".join(base64.b64encode(one.tobytes()).decode() for one in (size, data))
    columns = data.shape[1] if data.ndim > 1 else 1
    return (
        f'<DataArray type="{KINDS[data.dtype]}" Name={quoteattr(name)} '
        f'NumberOfComponents="{columns}" format="binary">{text}</DataArray>\n'
    )


def dxf(path: Path, frames: Frames, *, row: int | None = None) -> None:
    """Lines of release 12, bars and strings on layers of these names; lengths in m.

    Parameters
    ----------
    path : Path
    frames : Frames
    row : int, optional
        The instant, by its number.
    """
    (places,) = in_space(one(frames, row, ".dxf").places)
    text = ["0\nSECTION\n2\nENTITIES\n"]
    for ends, string in zip(frames.ends, frames.is_string, strict=True):
        text.append(f"0\nLINE\n8\n{'STRINGS' if string else 'BARS'}\n")
        for end, node in enumerate(places[ends].tolist()):
            text += [f"{10 * (k + 1) + end}\n{x!r}\n" for k, x in enumerate(node)]
    _write(path, "".join([*text, "0\nENDSEC\n0\nEOF\n"]))


def dump(path: Path, frames: Frames) -> None:
    """Sites as a dump of LAMMPS with radii and velocities, and in NAME.contacts.dump the forces of
    the contacts that are not open, as a dump of local values."""
    atoms, contacts = [], []
    velocity, nodes = frames.of_nodes.get("velocity [m/s]"), frames.places.shape[1]
    radius = [] if frames.radius is None else [frames.radius]
    names = "id type x y z" + " vx vy vz" * (velocity is not None) + " radius" * len(radius)
    tension = frames.of_segments.get("tension [N]", np.zeros((len(frames), 0)))
    every = in_space(frames.places).reshape(-1, 3)
    low, high = every.min(axis=0), every.max(axis=0)
    room = 1e-3 * float((high - low).max())
    sides = np.stack([low - room, high + room], axis=1).tolist()
    box = "ITEM: BOX BOUNDS ff ff ff\n" + "".join(f"{x!r} {y!r}\n" for x, y in sides)
    for k, at in enumerate(frames.at.tolist()):
        of = [np.arange(1, nodes + 1), np.ones(nodes, dtype=int), *in_space(frames.places[k]).T]
        of += [] if velocity is None else [*in_space(velocity[k]).T]
        start = f"ITEM: TIMESTEP\n{k}\nITEM: TIME\n{at!r}\n"
        rows = "".join(" ".join(map(repr, line)) + "\n" for line in _lines([*of, *radius]))
        atoms.append(f"{start}ITEM: NUMBER OF ATOMS\n{nodes}\n{box}ITEM: ATOMS {names}\n{rows}")
        closed = np.flatnonzero(tension[k])
        pairs = "".join(
            f"{i + 1} {j + 1} {force!r}\n"
            for (i, j), force in zip(frames.ends[closed], tension[k, closed].tolist(), strict=True)
        )
        count = f"ITEM: NUMBER OF ENTRIES\n{len(closed)}\n"
        contacts.append(f"{start}{count}{box}ITEM: ENTRIES id1 id2 force\n{pairs}")
    _write(path, "".join(atoms))
    if tension.shape[1]:
        _write(path.with_suffix(".contacts.dump"), "".join(contacts))


def _lines(columns: list[Array]) -> Iterator[tuple[Any, ...]]:
    return zip(*(column.tolist() for column in columns), strict=True)


@checked
def stl(
    path: Path,
    frames: Frames,
    *,
    radius: ArrayLike,
    joint: Positive | None = None,
    sides: Annotated[int, ">= 3"] = 16,
    scale: Positive = 1e3,
    row: int | None = None,
) -> None:
    """Tubes with balls at the nodes, as closed surfaces, for printing.

    Parameters
    ----------
    path : Path
    frames : Frames
    radius : float or array_like, (segments,)
        Of the tubes [m].
    joint : float, optional
        Radius of the balls [m], above 1.2 times that of a tube; by default 1.5 times the largest.
    sides : int, optional
        Of a tube and of the equator of a ball.
    scale : float, optional
        Units of the file in 1 m: a file has no unit, and slicers take mm.
    row : int, optional
        The instant, by its number.

    Raises
    ------
    TensegrityError
        A tube without length between its balls, or a surface that is not closed in the single
        precision of the file.
    """
    (places,) = in_space(one(frames, row, ".stl").places)
    each = check.floats("radius", radius)
    if each.shape not in ((), (len(frames.ends),)) or not (each > 0).all():
        raise TensegrityError(f"radius must be one number above 0 m or {len(frames.ends)} of them")
    each = np.broadcast_to(check.finite("radius", each), len(frames.ends))
    ball = 1.5 * float(each.max()) if joint is None else joint
    if not ball > 1.2 * each.max():
        raise TensegrityError(f"joint {ball:g} m must be above 1.2 radii, {1.2 * each.max():g} m")
    angle = np.pi * np.arange(sides // 2 + 1) / (sides // 2)
    half = np.stack([-ball * np.cos(angle), ball * np.sin(angle)], axis=1)
    bodies = [_turned(half, x, np.array([0.0, 0, 1]), sides) for x in places]
    for k, (tube, ends) in enumerate(zip(each, places[frames.ends], strict=True)):
        length = float(np.linalg.norm(ends[1] - ends[0]))
        if not length > 2 * ball:  # else the balls of two joints are one
            raise TensegrityError(
                f"member {k} has length {length:g} m, must be above two joints, {2 * ball:g} m"
            )
        # ends that lie inside the balls: at the nodes tubes would share the middles of their caps
        low, high = ball / 2, length - ball / 2
        side = np.array([[low, 0.0], [low, tube], [high, tube], [high, 0.0]])
        bodies.append(_turned(side, ends[0], (ends[1] - ends[0]) / length, sides))
    corners = (scale * np.concatenate(bodies)).astype("<f4")
    refuse_open(corners, str(path))
    made = np.zeros(len(corners), TRIANGLE)
    made["corners"] = corners
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    made["normal"] = normal / np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-30)
    with check.replacing(path) as new, open(new, "wb") as file:
        file.write(b"bars and strings as tubes".ljust(80) + np.uint32(len(made)).tobytes())
        file.write(made.tobytes())


def _turned(profile: Array, start: Array, axis: Array, sides: int) -> Array:
    """Triangles (n, 3, 3) of the surface that a profile makes as it turns about an axis.

    Parameters
    ----------
    profile : ndarray, (points, 2)
        Places along the axis and distances from it, which are 0 at both ends.
    start, axis : ndarray, (3,)
        A point on it, and its direction of length 1.
    sides : int

    Returns
    -------
    ndarray, (triangles, 3, 3)
        Seen from outside their corners turn to the left.
    """
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    angle = 2 * np.pi * np.arange(sides) / sides
    round_ = np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(axis, across))
    rings = start + profile[:, :1, None] * axis + profile[:, 1:, None] * round_
    low, high = rings[1:-2], rings[2:-1]
    next_low, next_high = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    first, last = rings[0, 0], rings[-1, 0]
    parts = [(low, next_low, next_high), (low, next_high, high)]
    parts += [(np.broadcast_to(first, rings[1].shape), np.roll(rings[1], -1, axis=0), rings[1])]
    parts += [(np.broadcast_to(last, rings[1].shape), rings[-2], np.roll(rings[-2], -1, axis=0))]
    return np.concatenate([np.stack(part, axis=-2).reshape(-1, 3, 3) for part in parts])


def refuse_open(corners: Array, name: str) -> None:
    """Refuse triangles (n, 3, 3) that are not the surfaces of bodies: each edge must be passed once
    in each direction."""
    flat = corners.reshape(-1, 3)
    number = np.unique(flat, axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges: Indices = np.stack([number, np.roll(number, -1, axis=1)], axis=-1).reshape(-1, 2)
    codes = edges @ [len(flat), 1]
    if len(np.unique(codes)) < len(codes) or not np.isin(edges @ [1, len(flat)], codes).all():
        raise TensegrityError(
            f"{name}: the surfaces are not closed in single precision; move the structure to the "
            "origin, or give larger radii"
        )


def _write(path: Path, text: str) -> None:
    with check.replacing(path) as new:
        new.write_text(text, encoding="utf-8")
