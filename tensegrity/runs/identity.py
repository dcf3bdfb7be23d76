"""Digests by which files tell scenes, cases and functions apart: equal contents have equal digests,
in any process, and others have others.

Contents are what a pickle would hold, without its memory of what is shared: numbers by type and
bits, arrays by dtype, shape and elements, other objects by class and state.  Functions and classes
of installed packages are known by name, all others also by their code, defaults, captured values
and the globals that they use.  What no pickle can hold is refused.
"""

from __future__ import annotations

import copyreg
import dis
import hashlib
import sys
import sysconfig
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

OWN = "tensegrity", "granular", "derivations"  # packages that count as installed
INSTALLED = tuple(sysconfig.get_path(name) for name in ("stdlib", "platstdlib"))
PLAIN = type(None), bool, int, float, complex, str, bytes
SAME = np.bool_, np.int64, np.float64, np.complex128, np.str_, np.bytes_  # as Python's own
DATA = (*PLAIN, tuple, list, dict, set, frozenset, np.ndarray)
PARTS: dict[type, Callable[[Any], Any]] = {}  # what objects of a class are built from, or None


def identity(x: Any) -> str:
    """Digest of the contents of any object.

    Parameters
    ----------
    x : object

    Returns
    -------
    str

    Raises
    ------
    TensegrityError
        Something in it has no contents that a digest can hold, such as a lock or an open file.
    """
    return Identities().of(x)


class Identities:
    """Digests of several objects; what these share is read once."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Any, bytes]] = {}  # with the object, so that its id stays
        self._open: dict[int, int] = {}  # objects being read, and how deep they lie

    def of(self, x: Any) -> str:
        """See `identity`."""
        try:
            return self._digest(x).hex()
        except RecursionError:
            raise TensegrityError(f"{check.shown(x)} is nested too deeply") from None
        finally:
            self._open.clear()

    def _digest(self, x: Any) -> bytes:
        if type(x) in SAME:
            x = x.item()
        if type(x) in PLAIN:
            return _hashed(type(x).__name__, _bits(x))
        if id(x) in self._open:
            return _hashed("again", str(self._open[id(x)]).encode())
        if id(x) not in self._known:
            self._open[id(x)] = len(self._open)
            self._known[id(x)] = x, _hashed(*self._contents(x))
            del self._open[id(x)]
        return self._known[id(x)][1]

    def _all(self, *values: Any) -> Iterator[bytes]:
        return map(self._digest, values)

    def _contents(self, x: Any) -> tuple[Any, ...]:
        """A word for the kind of an object, and bytes or digests of what is in it."""
        kind = type(x)
        if kind in (tuple, list):
            return kind.__name__, *self._all(*x)
        if kind is dict:
            return "dict", *self._all(*x.keys(), *x.values())
        if isinstance(x, (set, frozenset)):
            return "set", self._digest(kind), *sorted(self._all(*x))
        if kind is np.ndarray or isinstance(x, np.generic):
            return self._array(np.asarray(x), kind.__name__)
        if isinstance(x, ModuleType):
            return "module", x.__name__.encode()
        if isinstance(x, CodeType):
            return "code", *self._all(*_code(x))
        if isinstance(x, (FunctionType, type)):
            if _is_installed(x.__module__) and _found(x.__module__, x.__qualname__) is x:
                return "name", x.__module__.encode(), x.__qualname__.encode()
            return self._function(x) if isinstance(x, FunctionType) else self._class(x)
        if isinstance(x, MethodType):
            return "method", *self._all(x.__func__, x.__self__)
        if any(base.__module__.partition(".")[0] == "sympy" for base in kind.__mro__):
            return "expression", _printed(x).encode()
        parts = PARTS[kind](x) if kind in PARTS else None
        if parts is not None:
            return "parts", kind.__qualname__.encode(), self._digest(parts)
        return self._object(x)

    def _array(self, x: Any, kind: str) -> tuple[Any, ...]:
        head = kind, repr(x.dtype).encode(), str(x.shape).encode()
        if x.dtype.names:  # without the bytes between its fields
            return *head, *self._all(*(x[name] for name in x.dtype.names))
        if x.dtype.kind in "OT":
            return *head, *self._all(*x.ravel().tolist())
        if x.dtype.char in "gG":  # without the bytes that pad a long double
            return *head, *self._all(*map(repr, x.ravel()))
        return *head, x.tobytes()

    def _function(self, f: Any) -> tuple[Any, ...]:
        named = f"{f.__module__}.{f.__qualname__}"
        used = _captured(f) | _globals(f)
        found: list[bytes] = []
        for name, value in used.items():
            try:
                found += self._all(name, value)
            except TensegrityError as error:
                raise TensegrityError(f"{named} uses {name}: {error}") from error
        held = f.__code__, f.__defaults__, f.__kwdefaults__, vars(f)
        return "function", named.encode(), *self._all(*held), *found

    def _class(self, x: Any) -> tuple[Any, ...]:
        """A class by its name, bases, methods and attributes that are plain data."""
        found = [x.__bases__]
        for name, value in sorted(vars(x).items()):
            value = getattr(value, "__func__", getattr(value, "func", value))
            if isinstance(value, property):
                value = value.fget, value.fset, value.fdel
            is_data = isinstance(value, DATA) and name[:2] != "__"
            if is_data or isinstance(value, FunctionType):
                found += name, value
        return "class", x.__module__.encode(), x.__qualname__.encode(), *self._all(*found)

    def _object(self, x: Any) -> tuple[Any, ...]:
        """An object by what pickle would take from it."""
        reduced = copyreg.dispatch_table.get(type(x))
        try:
            made: Any = reduced(x) if reduced else x.__reduce_ex__(4)
        except Exception as error:
            raise TensegrityError(
                f"{check.shown(x)} has no contents to know it by: {error}"
            ) from error
        if isinstance(made, str):  # a name; what is in a cached function is the function
            what = getattr(x, "__module__", None), made, getattr(x, "__wrapped__", None)
            return "name", *self._all(type(x), *what)
        make, given, state, items, pairs = (*made, None, None, None)[:5]
        if isinstance(state, dict):
            state = {
                name: value
                for name, value in state.items()
                if not isinstance(getattr(type(x), str(name), None), cached_property)
            }
        return "object", *self._all(make, given, state, [*(items or ())], [*(pairs or ())])


def described(x: Any) -> str:
    """A function as messages name it, with what it captures; `repr` of anything else."""
    if isinstance(x, partial):
        given = [check.shown(one) for one in x.args]
        given += [f"{name}={check.shown(value)}" for name, value in x.keywords.items()]
        return f"{described(x.func)} with {', '.join(given) or 'no arguments'}"
    if not isinstance(getattr(x, "__qualname__", None), str):
        return check.text(x)
    name = f"{x.__module__}.{x.__qualname__}"
    if not isinstance(x, FunctionType) or _is_installed(x.__module__):
        return name
    used = _captured(x) | {k: v for k, v in _globals(x).items() if isinstance(v, DATA)}
    where = ", ".join(f"{key} = {check.shown(value)}" for key, value in used.items())
    return f"{name} where {where}" if where else name


def _hashed(kind: str, *parts: bytes) -> bytes:
    """Digest of parts, each after its length, so that no two lists of parts give the same."""
    digest = hashlib.sha256(kind.encode())
    for part in parts:
        digest.update(b"%d:" % len(part) + part)
    return digest.digest()


def _bits(x: Any) -> bytes:
    if isinstance(x, complex):
        return f"{x.real.hex()} {x.imag.hex()}".encode()
    if isinstance(x, float):
        return x.hex().encode()
    if isinstance(x, (bool, int)):
        return hex(x).encode()
    return x if isinstance(x, bytes) else str(x).encode("utf-8", "surrogatepass")


def _printed(x: Any) -> str:
    """A SymPy object as text; its dummy symbols, numbered by the process, in order."""
    from sympy import Dummy, srepr

    text = srepr(x)
    numbers = sorted(d.dummy_index for d in x.atoms(Dummy)) if hasattr(x, "atoms") else ()
    for number, old in enumerate(numbers):
        text = text.replace(f"dummy_index={old}", f"dummy_index={number}")
    return text


def _code(x: CodeType) -> tuple[Any, ...]:
    counts = x.co_argcount, x.co_posonlyargcount, x.co_kwonlyargcount, x.co_flags
    names = x.co_names, x.co_varnames, x.co_freevars, x.co_cellvars
    return counts, names, x.co_code, x.co_exceptiontable, x.co_consts


def _captured(f: Any) -> dict[str, Any]:
    """Values that a function captures, by name; a name without a value yet is left out."""
    found = {}
    for name, cell in zip(f.__code__.co_freevars, f.__closure__ or (), strict=True):
        try:
            found[name] = cell.cell_contents
        except ValueError:  # such as of a function that is not defined yet
            continue
    return found


def _globals(f: Any) -> dict[str, Any]:
    """Globals of a user's module that a function uses, and what it uses of such modules."""
    if _is_installed(f.__globals__.get("__name__", "")):
        return {}
    codes, loaded, attributes = [f.__code__], dict[str, Any](), list[str]()
    for code in codes:
        codes += [x for x in code.co_consts if isinstance(x, CodeType)]
        attributes += code.co_names
        steps = (x for x in dis.get_instructions(code) if x.opname in ("LOAD_GLOBAL", "LOAD_NAME"))
        loaded |= {x.argval: f.__globals__[x.argval] for x in steps if x.argval in f.__globals__}
    for name, value in [*loaded.items()]:
        if isinstance(value, ModuleType) and not _is_installed(value.__name__):
            of_it = (x for x in attributes if hasattr(value, x))
            loaded |= {f"{name}.{x}": getattr(value, x) for x in of_it}
    return loaded


def _is_installed(module: Any) -> bool:
    """Whether a module is Python's, of an installed package or of this one."""
    if not isinstance(module, str) or module in ("", "__main__"):
        return False
    if module.partition(".")[0] in OWN:
        return True
    there = sys.modules.get(module)
    file = getattr(there, "__file__", None)
    if file is None:  # compiled into Python, or made by a program
        return module in sys.builtin_module_names
    if {"site-packages", "dist-packages"}.intersection(Path(file).parts):
        return True
    return file.startswith(INSTALLED)


def _found(module: Any, name: str) -> Any:
    """What a name of a module stands for, or None."""
    there = sys.modules.get(module)
    for part in name.split("."):
        there = getattr(there, part, None)
    return there
