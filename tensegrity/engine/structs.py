"""Structures that C takes, filled by the names of their fields, which are read from the C text."""

from __future__ import annotations

import ctypes
import re
from importlib.resources import files
from typing import Any, ClassVar, Self

import numpy as np

from tensegrity.engine.native import address
from tensegrity.once import once

_NUMBERS = {"integer": ctypes.c_longlong, "double": ctypes.c_double}


class Structure(ctypes.Structure):
    """A structure of C, all of whose fields are given by name.

    Parameters
    ----------
    values : ndarray, Structure, int, float or None
        For a pointer an array or a structure, of which C gets the address, or an address; None
        leaves a field as it is, 0 at first.

    Attributes
    ----------
    kinds : dict of str
        Types of all fields.
    filled : dict of str
        The values given, which live as long as C may look at them.

    Raises
    ------
    TypeError
        Names are missing, or unknown.
    """

    __slots__ = ("filled",)
    kinds: ClassVar[dict[str, Any]]

    def __init__(self, **values: Any) -> None:
        if wrong := values.keys() ^ self.kinds.keys():
            raise TypeError(
                f"{', '.join(sorted(wrong))} of {type(self).__name__}: missing or unknown"
            )
        self.filled: dict[str, Any] = {}
        self.fill(**values)

    @classmethod
    def of(cls, **values: int) -> Self:
        """One of numbers and addresses alone, of some fields; the others are 0."""
        made = cls.__new__(cls)
        ctypes.Structure.__init__(made, **values)
        return made

    def fill(self, **values: Any) -> None:
        """Give some fields other values."""
        self.filled |= values
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value = address(value)
            elif isinstance(value, Structure) and self.kinds[name] is ctypes.c_void_p:
                value = ctypes.addressof(value)
            if value is not None:
                setattr(self, name, value)


@once
def structure(file: str, name: str) -> Any:
    """The `Structure` that a file of the engine declares as `typedef struct {...} name;`."""
    text = files(__package__).joinpath(file).read_text()
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    text = re.sub(r"\(\*(\w+)\)\([^()]*\)", r"*\1", text)  # functions, as other pointers
    (body,) = re.findall(rf"typedef struct \{{([^{{}}]*)\}} {name};", text)
    kinds: dict[str, Any] = {}
    for kind, names in re.findall(r"(?:const )?(?:unsigned )?(\w+) ([^;]*);", body):
        for one in names.split(","):
            found = ctypes.c_void_p if "*" in one else _NUMBERS.get(kind) or structure(file, kind)
            kinds[one.strip(" *\n")] = found
    made = {"__slots__": (), "kinds": kinds, "_fields_": list(kinds.items())}
    return type(name, (Structure,), made)
