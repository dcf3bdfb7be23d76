"""Records of instruments and programs as time series.

Text files are columns of numbers (`tensegrity.columns`) below a header.  Oscilloscopes of Tektronix
repeat the header beside the first rows; those of Rigol number the samples, with start and increment
in the header; those of Keysight and Digilent write times.  Units stand in brackets behind a name,
in a line of their own, or as "Vertical Units"; all that are found must agree.  The thermodynamic
tables in a log of LAMMPS are joined; of a dump the property of one atom is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.columns import LABEL, NUMBER, PREFIXES, read_columns, text_lines
from tensegrity.errors import TensegrityError
from tensegrity.measure.series import TimeSeries
from tensegrity.typing import Array

if TYPE_CHECKING:
    import pandas as pd

WORDS = {"second": "s", "seconds": "s", "sec": "s", "volt": "V", "volts": "V", "ampere": "A"}
UNIT = re.compile(r"(n|u|µ|m|k|M|)(s|V|A|N|Pa|m)")
KEYS = ("Horizontal Units", "Vertical Units")
CLOCK = re.compile(r"t0 *= *([^s,; ]+)s?[,; ]+tInc *= *([^s,; ]+)", re.IGNORECASE)
STEPS = ("Step", "TIMESTEP")  # what LAMMPS counts
TIMES = ("t", "time", "Time", "TIME")
HEAD = 40  # lines in which keys are sought


class _Read(NamedTuple):
    """Times in their unit, or numbers of samples of a clock, and readings."""

    t: Array
    values: Array
    columns: tuple[Any, Any]
    units: tuple[str, str] = ("", "")
    clock: tuple[float, float] | None = None  # interval and start [s]
    lines: Any = None  # of a text file, where samples may be missing

    def where(self, row: int) -> str:
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"


@checked
def read_record(
    path: str | PathLike[str] | pd.DataFrame | pd.Series,
    channel: int | str | tuple[int, str] | None = None,
    *,
    time: int | str | float | None = None,
    scale: Annotated[float, ""] = 1.0,
    offset: Annotated[float, ""] = 0.0,
    unit: str | None = None,
    noise: Annotated[float, ">= 0"] | None = None,
) -> TimeSeries:
    """Read one channel of a record.

    Parameters
    ----------
    path : path, or DataFrame or Series of pandas
        A text file of columns, such as the CSV of an oscilloscope (Tektronix, Keysight, Digilent,
        Rigol and others), or a log or a dump of LAMMPS; a file of NumPy (.npy, .npz) or of HDF5
        (.h5, .hdf5).
    channel : int, str or (int, str), optional
        Column, from 0, or its name with or without unit; of .npz and HDF5 the name of an array; of
        a dump the id of an atom and a property, such as (12, "fx").  By default the first column
        that does not hold times.
    time : int, str or float, optional
        Column or name of the times; or, as a float, the interval between rows [s], where LAMMPS
        counts steps that of a step.  By default the first column, or the clock in the header.
    scale, offset : float, optional
        The values are scale*reading + offset, of readings in units without prefix: V of mV.
    unit : str, optional
        Of the values; by default that of the file, N if there is a scale.
    noise : float, optional
        As of `TimeSeries`, of the values; by default estimated.

    Returns
    -------
    TimeSeries
        Samples that are missing, as empty fields or 9.91e37, or between the instants of a clock,
        are left out, and stand in `lost`.

    Raises
    ------
    TensegrityError
        No such file, column or array; by file, line and column what is no finite number, times that
        do not increase, units that differ or are not those of a time.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tensegrity import read_record
    >>> rigol = "X,CH1,Start,Increment\\nSequence,Volt,-2e-6,1e-6\\n0,0.1,,\\n1,0.2,,\\n2,0.4,,\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "sensor.csv")
    ...     _ = file.write_text(rigol)
    ...     print(read_record(file, scale=50.0))
    3 samples from -2e-06 to 0 s, every 1e-06 s
    5 to 20 N, noise 0 N
    """
    check.kind("unit", "" if unit is None else unit, str)
    if isinstance(time, (float, np.floating)):
        time = check.number("time", time, above=0, unit="s")
    elif time is not None and not isinstance(time, str):
        time = check.whole("time", time, least=0)
    if type(path).__module__.split(".")[0] == "pandas":
        name, read = "the frame", _of_frame(path, channel, time)
    else:
        file = check.path("path", path)
        name, read = str(file), FORMATS.get(file.suffix.lower(), _of_text)(file, channel, time)
    by, units = zip(*map(_base, read.units), strict=True)
    if units[0] not in ("", "s"):
        raise TensegrityError(f"{name}, column {read.columns[0]}: {units[0]} is no unit of time")
    step, start = read.clock or (by[0], 0.0)
    t = start + step * _finite(name, read, 0)
    rows = np.flatnonzero(np.isfinite(_finite(name, read, 1)) & np.isfinite(t))
    for k in rows[1:][~(np.diff(t[rows]) > 0)][:1].tolist():
        before = t[rows[rows < k][-1]]
        words = ": printed rounded? give time=interval" if t[k] == before else ""
        raise TensegrityError(
            f"{name}, {read.where(k)}, column {read.columns[0]}: time {t[k]:.9g} s follows "
            f"{before:.9g} s, must increase{words}"
        )
    unit = unit if unit is not None else "N" if scale != 1 else units[1]
    try:
        return TimeSeries(t[rows], scale * by[1] * read.values[rows] + offset, unit, noise)
    except TensegrityError as error:
        raise TensegrityError(f"{name}: {error}") from None


def _finite(name: str, read: _Read, which: int) -> Array:
    """Times or values, of which those of a text file may be missing."""
    values = (read.t, read.values)[which]
    for k in np.flatnonzero(~np.isfinite(values))[: 1 if read.lines is None else 0].tolist():
        raise TensegrityError(
            f"{name}, {read.where(k)}, column {read.columns[which]}: {values[k]} is not finite"
        )
    return values


def _base(text: str) -> tuple[float, str]:
    """What values in a unit are multiplied by, and the unit without prefix."""
    word = WORDS.get(text.lower(), text)
    found = UNIT.fullmatch(word)
    return (10.0 ** PREFIXES[found[1]], found[2]) if found else (1.0, word)


def _of_text(file: Path, channel: Any, time: Any) -> _Read:
    file, lines = text_lines(file)
    at, of, clock = _layout(file, lines)
    if lines and lines[0].startswith("ITEM:"):
        lines, at, channel = _atom(file, lines, channel)
    elif any(line.split()[:1] == ["Step"] for line in lines):
        lines, at = _tables(lines)
    if isinstance(time, float):
        clock, of = (time, 0.0), int(at in STEPS)
        at = at if at in STEPS else None
    elif time is not None:
        clock, at = None, time
    elif at in STEPS:
        raise TensegrityError(f"{file}, column {at}: give the duration of a step, time=")
    of = of if channel is None else channel
    if not isinstance(of, str):
        of = check.whole("channel", of, least=0)
    wanted = [of] if at is None else [at, of]
    found = read_columns(file, lines, wanted, gaps=True)
    units = [_unit(file, lines, found, k) for k in range(-len(wanted), 0)]
    t = np.arange(float(len(found.lines))) if at is None else found.values[:, 0]
    units = "" if clock else units[0], units[-1]
    return _Read(t, found.values[:, -1], (at, of), units, clock, found.lines)


def _layout(file: Path, lines: list[str]) -> tuple[Any, int, tuple[float, float] | None]:
    """Columns of times, None if there are none, and of values; interval and start of a clock."""
    one, two = ([x.strip() for x in line.split(",")] for line in (*lines, "", "")[:2])
    if one[0] == "Record Length" and len(one) > 4:
        return 3, 4, None
    if {"Start", "Increment"} <= {*one}:
        at, of, number, known = 0, 1, 2, dict(zip(one, two, strict=False))
        texts = known.get("Increment", ""), known.get("Start", "")
    elif found := CLOCK.search(",".join(one)):
        at, of, number, texts = None, 0, 1, (found[2], found[1])
    else:
        return 0, 1, None
    for text in texts:
        if not NUMBER.fullmatch(text):
            raise TensegrityError(f"{file}, line {number}: {text!r} of its clock is no number")
    return at, of, (float(texts[0]), float(texts[1]))


def _unit(file: Path, lines: list[str], found: Any, which: int) -> str:
    """The unit of a column in the header, as written; all that are there must agree."""
    seen = {}
    for number, line in enumerate(lines[:HEAD], 1):
        key, _, rest = line.partition(",")
        if key == KEYS[which]:
            seen[number] = rest.split(",")[0].strip()
    for number, fields in [one for one in found.head if any(one[1])][-2:]:
        text = fields[found.places[which]] if found.places[which] < len(fields) else ""
        bracket = LABEL.fullmatch(text)
        if bracket or text.lower() in WORDS or UNIT.fullmatch(text):
            seen[number] = bracket[2] if bracket else text
    for number, text in seen.items():
        first = next(iter(seen.items()))
        if _base(text) != _base(first[1]):
            raise TensegrityError(
                f"{file}, line {number}, column {found.places[which]}: unit {text!r}, but "
                f"{first[1]!r} in line {first[0]}"
            )
    return next(iter(seen.values()), "")


def _tables(lines: list[str]) -> tuple[list[str], str]:
    """The lines of a log of LAMMPS, empty but for the first heading and the rows of all tables, and
    what counts time; a table begins with the step that the one before ended with."""
    kept, inside, last, names = [], False, "", [""]
    for line in lines:
        word = next(iter(line.split()), "")
        heading, row = word == "Step", inside and NUMBER.fullmatch(word)
        kept.append(line if (heading and not last) or (row and word != last) else "")
        inside = bool(heading or row or (inside and word.startswith("WARNING")))
        last, names = (word if row else last), (line.split() if heading else names)
    return kept, next((one for one in TIMES if one in names), "Step")


def _atom(file: Path, lines: list[str], channel: Any) -> tuple[list[str], str, str]:
    """The lines of a dump of LAMMPS, empty but for the first heading and those of an atom, with the
    time before them; what counts it, and the property."""
    if not (isinstance(channel, tuple) and len(channel) == 2 and isinstance(channel[1], str)):
        raise TensegrityError(
            f"{file}: channel {check.shown(channel)} of a dump must be an atom and a property, "
            "such as (1, 'fx')"
        )
    atom = str(check.whole("atom", channel[0], least=0))
    at = "TIME" if "ITEM: TIME" in lines else "TIMESTEP"
    kept, item, now, names = [], "", "", [""]
    for line in lines:
        fields, heading = line.split(), item != "ATOMS"
        if fields[:1] == ["ITEM:"]:
            item, names = fields[1], fields[2:]
            kept.append(f"# {at} {' '.join(names)}" if item == "ATOMS" and heading else "")
            continue
        now = fields[0] if item == at and fields else now
        mine = item == "ATOMS" and dict(zip(names, fields, strict=False)).get("id") == atom
        kept.append(f"{now} {line}" if mine else "")
    if not any(line and line[0] != "#" for line in kept):
        raise TensegrityError(f"{file}: no atom {atom} with an id")
    return kept, at, channel[1]


def _of_frame(frame: Any, channel: Any, time: Any) -> _Read:
    """Columns of a frame of pandas; its index holds the times unless a column does."""
    columns = frame.to_dict("series") if hasattr(frame, "columns") else {"value": frame}
    index = frame.index
    if time is None and not {*TIMES} & {*columns}:
        if hasattr(index, "tz_localize"):  # dates
            index = index - index[0]
        seconds = getattr(index, "total_seconds", None)
        columns = {TIMES[0]: seconds() if seconds else index, **columns}
    return _of_arrays("the frame", columns, {}, channel, time)


def _of_numpy(file: Path, channel: Any, time: Any) -> _Read:
    try:
        found = np.load(file)
        arrays = dict(found) if hasattr(found, "files") else found
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        raise TensegrityError(f"{file} cannot be read: {error}") from None
    if isinstance(arrays, np.ndarray):
        arrays = dict(enumerate(arrays.reshape(len(arrays), -1).T if arrays.ndim else ()))
    return _of_arrays(str(file), arrays, {}, channel, time)


def _of_hdf5(file: Path, channel: Any, time: Any) -> _Read:
    """Arrays of one axis by their paths; units are their attributes."""
    h5py = check.package("h5py", "reading HDF5", "data")
    arrays, units = {}, {}

    def visit(name: str, one: Any) -> None:
        if isinstance(one, h5py.Dataset) and one.ndim == 1:
            arrays[name] = one[()]
            units[name] = str(one.attrs.get("units", one.attrs.get("unit", "")))

    try:
        with h5py.File(file) as opened:
            opened.visititems(visit)
    except OSError as error:
        raise TensegrityError(f"{file} cannot be read: {error}") from None
    return _of_arrays(str(file), arrays, units, channel, time)


def _of_arrays(
    name: str, arrays: Mapping[Any, Any], units: Mapping[Any, str], channel: Any, time: Any
) -> _Read:
    """Times and values among arrays by their names, or by their numbers."""
    clock, at = ((time, 0.0), None) if isinstance(time, float) else (None, time)
    if clock is None and at is None:
        at = next((one for one in (*TIMES, *arrays) if one in arrays), None)
    of = next((one for one in arrays if one != at), None) if channel is None else channel
    for one in (of,) if clock else (at, of):
        if not isinstance(one, (str, int)) or one not in arrays:
            known = ", ".join(map(str, arrays)) or "nothing"
            raise TensegrityError(f"{name}: column {check.shown(one)} is not one of {known}")
    values = check.floats(f"{name}, column {of}", arrays[of])
    t = np.arange(float(len(values))) if clock else check.floats(f"{name}, column {at}", arrays[at])
    if values.ndim != 1 or t.shape != values.shape:
        raise TensegrityError(
            f"{name}: columns {at} and {of} have shapes {t.shape} and {values.shape}, must be one"
        )
    return _Read(t, values, (at, of), (units.get(at, ""), units.get(of, "")), clock)


FORMATS = {".npy": _of_numpy, ".npz": _of_numpy, ".h5": _of_hdf5, ".hdf5": _of_hdf5}
