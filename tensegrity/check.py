"""Checks of a user's input; a failed one raises an error that names quantity, value and bound.

Numbers are the real numbers of Python and NumPy; truth values, text and complex numbers are not.
"""

from __future__ import annotations

import importlib
import math
import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegrity.errors import TensegrityError

T = TypeVar("T")
LONGEST = 80  # most characters of a value in a message
LEAST = -sys.maxsize
LARGEST = math.inf, sys.float_info.max  # where infinity is taken, and where it is refused
NESTED = list, tuple, np.ndarray


def number(
    name: str,
    value: object,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    below: float | None = None,
    finite: bool = True,
    unit: str = "",
) -> float:
    """Convert to a float one number within its bounds.

    Parameters
    ----------
    name : str
        Name in messages.
    value : object
    above, least, most, below : float, optional
        The number must be > above, >= least, <= most and < below.
    finite : bool, optional
        Whether infinity is refused.
    unit : str, optional
        Unit in messages.

    Returns
    -------
    float

    Raises
    ------
    TensegrityError
    """
    bounds = above, least, most, below
    if type(value) is float and abs(value) <= LARGEST[finite] and not _missed(value, *bounds):
        return value
    value = _scalar(value)
    if not (_is(value, Real) or _is_symbolic_constant(value)):
        raise TensegrityError(f"{name} {shown(value)} is not a number")
    try:
        value = float(value)
    except OverflowError:
        raise TensegrityError(f"{name} must be within {sys.float_info.max:g} in size") from None
    words = f"{name} {value:g}{unit and ' ' + unit}"
    if math.isnan(value) or (finite and math.isinf(value)):
        raise TensegrityError(f"{words} is not {'finite' if finite else 'a number'}")
    if missed := _missed(value, *bounds):
        raise TensegrityError(f"{words} must be {missed}")
    return value


def _missed(
    value: float, above: float | None, least: float | None, most: float | None, below: float | None
) -> str:
    """The bound that a number violates, in words, or ""."""
    if above is not None and not value > above:
        return f"above {above:g}"
    if least is not None and not value >= least:
        return f"at least {least:g}"
    if most is not None and not value <= most:
        return f"at most {most:g}"
    if below is not None and not value < below:
        return f"below {below:g}"
    return ""


def whole(name: str, value: object, *, least: int = LEAST, below: int | None = None) -> int:
    """Convert to an int a whole number within its bounds.

    Parameters
    ----------
    name : str
        Name in messages.
    value : object
    least, below : int, optional
        The number must be >= least and < below.

    Returns
    -------
    int

    Raises
    ------
    TensegrityError
    """
    value = _scalar(value)
    if not _is(value, Integral):
        raise TensegrityError(f"{name} {shown(value)} is not a whole number")
    if value < least:
        raise TensegrityError(f"{name} {shown(value)} must be at least {least}")
    if value > sys.maxsize:
        raise TensegrityError(f"{name} must be at most {sys.maxsize}")
    if below is not None and value >= below:
        raise TensegrityError(f"{name} {value} must be below {below}")
    return int(value)


def truth(name: str, value: object) -> bool:
    """`value` as a bool, if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise TensegrityError(f"{name} {shown(value)} must be True or False")
    return bool(value)


def kind(name: str, value: T, wanted: type) -> T:
    """A value, if it is an instance of a class.

    Parameters
    ----------
    name : str
        Name in messages.
    value : object
    wanted : type
        Its `_given_by`, if it has one, ends the message.

    Returns
    -------
    object

    Raises
    ------
    TensegrityError
    """
    if not isinstance(value, wanted):
        article = "an" if wanted.__name__[0] in "AEIOU" else "a"
        words = getattr(wanted, "_given_by", "") or made_by(value, wanted)
        raise TensegrityError(f"{name} {shown(value)} is not {article} {wanted.__name__}{words}")
    return value


def made_by(value: object, wanted: type) -> str:
    """Which method of a value gives what is wanted, as a prism gives its potential; or ""."""
    method = wanted.__name__.lower()
    if not callable(getattr(value, method, None)):
        return ""
    return f": give {type(value).__name__.lower()}.{method}()"


def floats(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Numbers as an array of float64, C-contiguous, of any shape.

    Integers, other floats, views and sequences are converted; an array of the right kind is
    returned itself.  Complex numbers, truth values, text, objects and masked entries are refused.
    """
    unmasked(name, value)
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "iuf":
            raise TensegrityError(f"{name} has dtype {value.dtype}, must be real numbers")
    elif type(value) is not float:
        value = _array(name, value)
    with np.errstate(over="ignore"):  # a long double may be inf as a float64
        return np.require(value, np.float64, ("C", "A", "E"))


def unmasked(name: str, value: object) -> None:
    """Refuse a masked array with masked entries, or a sequence of such arrays."""
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        where = int(np.flatnonzero(np.ma.getmaskarray(value))[0])
        raise TensegrityError(f"{name} is masked at index {where}: a mask is not taken, fill it")
    if isinstance(value, (list, tuple)) and value and isinstance(value[0], NESTED):
        for one in value:
            unmasked(name, one)


def numbers(name: str, value: ArrayLike, unit: str) -> NDArray[np.float64]:
    """Numbers converted as by `floats`, none of them NaN; infinity is allowed.

    Parameters
    ----------
    name, unit : str
        In messages.
    value : array_like

    Returns
    -------
    ndarray of float64

    Raises
    ------
    TensegrityError
    """
    value = floats(name, value)
    if np.isnan(value).any():
        raise TensegrityError(f"{name} nan {unit} is not a number")
    return value


def vector(name: str, value: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """A state array for the compiled loop: float64, C-contiguous, finite and of a given shape.

    Parameters
    ----------
    name : str
        Name in messages.
    value : array_like
        Converted as by `floats`; an array of the right kind is not copied.
    shape : tuple of int

    Returns
    -------
    ndarray of float64, of that shape

    Raises
    ------
    TensegrityError
    """
    value = floats(name, value)
    if value.shape != shape:
        raise TensegrityError(f"{name} has shape {value.shape}, must be {shape}")
    return finite(name, value)


def columns(**given: ArrayLike) -> list[NDArray[np.float64]]:
    """Arrays by their names: of one axis and one length, not empty, converted as by `vector`."""
    arrays = {name: floats(name, value) for name, value in given.items()}
    name, shape = next((name, value.shape) for name, value in arrays.items())
    if len(shape) != 1 or not shape[0]:
        raise TensegrityError(f"{name} has shape {shape}, must have one axis, (n,)")
    return [vector(name, value, shape) for name, value in arrays.items()]


def finite(name: str, value: NDArray[Any]) -> NDArray[Any]:
    """An array, if all its numbers are finite."""
    if not np.isfinite(value).all():
        where = int(np.flatnonzero(~np.isfinite(value.ravel()))[0])
        raise TensegrityError(f"{name} is {value.ravel()[where]} at index {where}, must be finite")
    return value


def rows(
    name: str, value: ArrayLike, shape: tuple[int, ...], are_finite: bool = True
) -> NDArray[np.float64]:
    """Numbers whose last axes have a given shape, such as states at many instants.

    Parameters
    ----------
    name : str
        Name in messages.
    value : array_like
        Arrays of floats keep their precision; others are converted as by `floats`.
    shape : tuple of int
    are_finite : bool, optional
        Whether all must be finite.

    Returns
    -------
    ndarray, (..., *shape)

    Raises
    ------
    TensegrityError
    """
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f":
        value = floats(name, value)
    unmasked(name, value)
    if value.shape[max(value.ndim - len(shape), 0) :] != shape:
        raise TensegrityError(f"{name} of shape {value.shape} must have shape (..., *{shape})")
    return finite(name, value) if are_finite else value


def sequence(name: str, value: Any, of: str) -> tuple[Any, ...]:
    """The items of a sequence, a set or another iterable, except text and arrays of dimension 0.

    Parameters
    ----------
    name : str
        Name in messages.
    value : iterable
    of : str
        What the items are, in messages.

    Returns
    -------
    tuple

    Raises
    ------
    TensegrityError
    """
    try:
        if not isinstance(value, (str, bytes)):
            return tuple(value)
    except TypeError:
        pass
    raise TensegrityError(f"{name} {shown(value)} must be a sequence of {of}")


def package(name: str, what: str, extra: str) -> Any:
    """Import an optional package.

    Parameters
    ----------
    name : str
        Of the package.
    what : str
        The feature that needs it, for the message.
    extra : str
        The extra of this distribution that installs it.

    Returns
    -------
    module

    Raises
    ------
    TensegrityError
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise TensegrityError(
            f"{what} needs {name}, which is not installed: install this package with [{extra}]"
        ) from error


def path(name: str, value: object) -> Path:
    """A path that names something, from text or a path."""
    if not isinstance(value, (str, os.PathLike)):
        raise TensegrityError(f"{name} {shown(value)} is not a path")
    if not Path(value).name or "\0" in str(value):
        raise TensegrityError(f"{name} {shown(str(value))} names no file")
    return Path(value)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A context for a file beside another one, which replaces it once it is written and on the
    disk; if writing fails, the other file stays unchanged.

    The file's name is its own, so that two processes can replace one file, and has the same ending,
    by which some writers know a format.  A link is followed; what is no file, such as /dev/stdout,
    is written directly.  An `OSError` in the context is a `TensegrityError` that names the file.
    """
    is_file, there = path.is_file() or not path.exists(), Path(os.path.realpath(path))
    new = there.with_name(f".{there.stem[:99]}.{secrets.token_hex(4)}{there.suffix}")
    try:
        yield new if is_file else path
        if is_file:
            with open(new, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(new, there)
    except BaseException as error:
        with suppress(OSError):
            new.unlink()
        if isinstance(error, OSError):
            raise TensegrityError(f"{path} cannot be written: {error.strerror or error}") from error
        raise


def memory(what: str, size: float) -> None:
    """Refuse an operation that needs more than the free memory; `size` in bytes."""
    free = free_memory()
    if size > free:
        raise TensegrityError(
            f"{what} would take {size / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free"
        )


def free_memory() -> int:
    """Memory that is available without swapping [bytes]."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(int(x.split()[1]) * 1024 for x in lines if x.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def text(value: object) -> str:
    """`repr` of any value."""
    try:
        return repr(value)
    except (ValueError, RecursionError):  # an int of thousands of digits, a deep list
        return f"of type {type(value).__name__}"


def shown(value: object) -> str:
    """`repr` of any value, shortened."""
    whole = text(value)
    return whole if len(whole) <= LONGEST else f"{whole[: LONGEST - 3]}..."


def differing(one: str, other: str) -> tuple[str, str]:
    """Two texts, shortened to the vicinity of their first difference."""
    pairs = enumerate(zip(one, other, strict=False))
    alike = next((k for k, (a, b) in pairs if a != b), min(len(one), len(other)))
    first = max(alike - LONGEST // 2, 0)
    parts = ((x, x[first : first + LONGEST]) for x in (one, other))
    dots = "..." if first else ""
    left, right = (f"{dots}{part}{'...' * (not x.endswith(part))}" for x, part in parts)
    return left, right


def _scalar(value: Any) -> Any:
    """The number in an array of dimension 0; any other value itself."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _is(value: object, tower: type) -> bool:
    return isinstance(value, tower) and not isinstance(value, (bool, np.timedelta64))


def _is_symbolic_constant(value: object) -> bool:
    """Whether a SymPy expression is a real number, such as pi/6."""
    return all(getattr(value, name, False) is True for name in ("is_number", "is_extended_real"))


def _array(name: str, value: Any) -> Any:
    try:
        array = np.array(value)
        if array.dtype.kind in "iuf" and not _has_truth(value):
            return array
    except (TypeError, ValueError, OverflowError):
        pass
    raise TensegrityError(f"{name} {shown(value)} is not made of numbers")


def _has_truth(value: Any) -> bool:
    """Whether a nested sequence holds truth values, which NumPy converts to 0 and 1."""
    flat = np.array(value, dtype=object).ravel()
    return not {bool, np.bool_}.isdisjoint(map(type, flat))
