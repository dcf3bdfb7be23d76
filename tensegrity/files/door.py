"""Reading and writing by the suffix of a path."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipFile, is_zipfile

from tensegrity import check
from tensegrity.branches.table import Table
from tensegrity.errors import TensegrityError
from tensegrity.files.geometry import dump, dxf, pvd, stl, vtp
from tensegrity.files.mjcf import write_mjcf
from tensegrity.files.records import read_record
from tensegrity.files.sheets import read_sheets, sheets, write_sheets
from tensegrity.lattices.lattice import Lattice
from tensegrity.runs.run import Run
from tensegrity.structures.structure import Structure


def write(path: str | PathLike[str], thing: Any, **options: Any) -> None:
    """Write a thing to a file in the format of its suffix.

    Parameters
    ----------
    path : str or path
        A file that is there is replaced, completely or not at all.  The suffixes are

        =========  ===============================================================================
        .csv       Structure and Lattice: the sheets NAME.nodes.csv and NAME.members.csv; paths,
                   runs and their tables: columns with units
        .vtp       lines and points for ParaView and PyVista, with tension, force density, slackness
                   and stiffness; of one instant, of several with `row=`
        .pvd       the same of all instants, as a list of the files NAME.0000.vtp and so on
        .dxf       lines on the layers BARS and STRINGS; `row=`
        .stl       tubes and balls for printing: `radius=`, `joint=`, `sides=`, `scale=`, `row=`
        .dump      sites with velocities and radii, and NAME.contacts.dump with the forces between
                   them, as LAMMPS writes them
        .xml       Structure: a model of MuJoCo, `gravity=`, `dt=`
        .npz       Run: as `Run.save`
        =========  ===============================================================================
    thing : Structure, Lattice, StructureModes, StructurePath, Run or Table
        What has `frames` is written to .vtp, .pvd, .dxf, .stl and .dump.
    **options
        Those of the format, the others of `frames`: `counts=` of a lattice, `number=` of modes.

    Raises
    ------
    TensegrityError
        A suffix or an option that is none of these, a thing that the format does not hold, or a
        file that cannot be written.

    Examples
    --------
    >>> from tensegrity import catalogue, files
    >>> octahedron = catalogue.expandable_octahedron(1.0, prestrain=0.1)
    >>> files.write("octahedron.vtp", octahedron)
    >>> files.write("octahedron.csv", octahedron)
    >>> print(repr(files.read("octahedron.csv")))
    Structure(12 nodes in 3 dimensions, 6 bars, 24 strings, 0 of them slack)
    """
    path = check.path("path", path)
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        words = f"{path}: suffix {check.shown(suffix)} must be one of"
        raise TensegrityError(f"{words} {', '.join(WRITERS)}")
    WRITERS[suffix](path, thing, options)


def read(path: str | PathLike[str], **options: Any) -> Any:
    """Read what a file holds, by its suffix and content; nothing in it is evaluated.

    Parameters
    ----------
    path : str or path
        .csv: a sheet NAME.nodes.csv or NAME.members.csv, or NAME.csv where these two are there;
        .npz: a run that was saved.  Everything else is a record: CSV, logs and dumps, NumPy, HDF5.
    **options
        Of a record, those of `read_record`.

    Returns
    -------
    Structure, Lattice, Run or TimeSeries
        Nodes and members in the order of their rows, bars first and cables last.  Columns of
        members are kind (bar or string), from, to, over (nodes of a cable), k or EA, natural
        length, mass, buckling load; what is left out has the default of `Structure`.  "length" and
        "tension" are results, and are not read.

    Raises
    ------
    TensegrityError
        No such file; wrong or repeated columns and names, units of another quantity, and values
        that are no numbers or out of bounds, with file, line and column; as `read_record`.
    """
    path = check.path("path", path)
    if path.suffix.lower() == ".csv" and any(one.exists() for one in sheets(path)):
        _refuse_others(path, options, set())
        return read_sheets(path)
    if path.suffix.lower() == ".npz" and _is_run(path):
        _refuse_others(path, options, set())
        return Run.load(path)
    return read_record(path, **options)


def _is_run(path: Path) -> bool:
    """Whether a file is as `Run.save` writes it."""
    if not is_zipfile(path):
        return False
    with ZipFile(path) as file:
        return "text.npy" in file.namelist()


def _taken(function: Callable[..., Any]) -> set[str]:
    """Names of the options of a function."""
    found = inspect.signature(function).parameters.values()
    return {one.name for one in found if one.kind is one.KEYWORD_ONLY}


def _refuse_others(path: Path, options: dict[str, Any], known: set[str]) -> None:
    for name in sorted(options.keys() - known):
        words = ", ".join(sorted(known)) or "none"
        raise TensegrityError(f"{path}: unknown option {name}, known are {words}")
    if "radius" in known and "radius" not in options:
        raise TensegrityError(f"{path} needs radius= of the tubes [m]")


def _of_frames(function: Callable[..., None]) -> Callable[[Path, Any, dict[str, Any]], None]:
    def write_frames(path: Path, thing: Any, options: dict[str, Any]) -> None:
        if not callable(frames := getattr(thing, "frames", None)):
            raise TensegrityError(f"{path}: {check.shown(thing)} has no frames, as structures do")
        own, others = _taken(function), {*inspect.signature(frames).parameters}
        _refuse_others(path, options, own | others)
        shot = frames(**{name: options[name] for name in options.keys() & others})
        function(path, shot, **{name: options[name] for name in options.keys() & own})

    return write_frames


def _of_thing(function: Callable[..., None]) -> Callable[[Path, Any, dict[str, Any]], None]:
    def write_thing(path: Path, thing: Any, options: dict[str, Any]) -> None:
        _refuse_others(path, options, _taken(function))
        function(path, thing, **options)

    return write_thing


def _csv(path: Path, thing: Any, options: dict[str, Any]) -> None:
    if isinstance(thing, (Structure, Lattice)):
        return _of_thing(write_sheets)(path, thing, options)
    if isinstance(thing, Run):
        _refuse_others(path, options, {"quantity", "sites", "times"})
        thing = thing.table(**options)
    elif options:
        _refuse_others(path, options, set())
    check.kind("thing", thing, Table).to_csv(path)


def _npz(path: Path, thing: Any, options: dict[str, Any]) -> None:
    _refuse_others(path, options, set())
    check.kind("thing", thing, Run).save(path)


WRITERS: dict[str, Callable[[Path, Any, dict[str, Any]], None]] = {
    ".csv": _csv,
    **{f".{f.__name__}": _of_frames(f) for f in (vtp, pvd, dxf, stl, dump)},
    ".xml": _of_thing(write_mjcf),
    ".npz": _npz,
}
