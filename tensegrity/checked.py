"""Checks that are declared: `checked` makes a function refuse what its annotations do not allow.

    @checked
    def duration(run: Run, bond: Index, level: Annotated[float, "> 0", "< 1"] = 0.05) -> float:

A float is converted by `check.number`, an int by `check.whole`, a bool by `check.truth`; an
instance of a class is asked by `check.kind`.  `Annotated` holds what else they are told: bounds
such as "> 0", ">= 1", "<= 0.5" or f"< {FASTEST}", the unit, and "or inf"; text is one of a
collection, `Annotated[str, KINDS]`.  None is taken where the annotation has it.  What recurs has a
name in `tensegrity.typing`.

The rest is left to the body: unions of several types; arrays and sequences, which are of another
type once they are converted; classes imported for the type checker alone.  Defaults are not
checked.  Of a class, also of a dataclass, the arguments of `__init__` are checked, before all else.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Collection
from functools import partial, wraps
from types import NoneType, UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

from tensegrity import check, typing
from tensegrity.errors import TensegrityError
from tensegrity.typing import Function


def _one_of(name: str, value: object, allowed: Collection[str]) -> str:
    if isinstance(value, str) and value in allowed:
        return value
    raise TensegrityError(f"{name} {check.shown(value)} must be one of {', '.join(allowed)}")


CHECKS: dict[Any, Any] = {float: check.number, int: check.whole, bool: check.truth, str: _one_of}
BOUNDS = {">=": "least", ">": "above", "<": "below", "<=": "most"}
NAMED = [name for name, value in vars(typing).items() if get_origin(value) is Annotated]
ANNOTATED = re.compile(rf"\bAnnotated\[(\w+), [^]]*\]|\b({'|'.join(NAMED)})\b")


class Declared(NamedTuple):
    """What an annotation says of an argument."""

    kind: type
    keywords: dict[str, Any]  # of the function that checks it
    optional: bool  # whether None is taken

    @property
    def range(self) -> tuple[float, float]:
        """The open interval of the numbers that are taken."""
        said, largest = self.keywords, sys.maxsize if self.kind is int else math.inf
        least, most = said.get("least", -largest), said.get("most", largest)
        below = least - 1 if self.kind is int else math.nextafter(least, -math.inf)
        above = largest if most == largest else math.nextafter(most, math.inf)
        return said.get("above", below), said.get("below", above)

    def check(self, name: str) -> Callable[[Any], Any]:
        """A function that checks and converts a value, under its name in messages."""
        kind, optional = self.kind, self.optional
        of = partial(CHECKS.get(kind, check.kind), name, **self.keywords)
        if kind not in (float, int):
            return lambda x: x if x is None and optional else of(x)
        low, high = self.range

        def number(x: Any) -> Any:
            if (type(x) is kind and low < x < high) or (x is None and optional):
                return x  # as nearly always: the function of `check` takes longer
            return of(x)

        return number


def checked(thing: Function) -> Function:
    """A function or class that checks its arguments; its signature shows their types alone."""
    if isinstance(thing, type):
        thing.__init__ = checked(thing.__init__)  # type: ignore[misc]
        return thing
    texts = dict(thing.__annotations__)
    thing.__annotations__.update((name, _plain(text)) for name, text in texts.items())
    checks: list[tuple[str, int, Callable[[Any], Any]]] = []

    @wraps(thing)
    def call(*given: Any, **named: Any) -> Any:
        if not checks:  # the first call: what the annotations name is imported by now
            names = thing.__code__.co_varnames[: thing.__code__.co_argcount]
            place = {name: k for k, name in enumerate(names)}
            found = _declared(texts, thing.__globals__).items()
            checks[:] = [(x, place.get(x, sys.maxsize), one.check(x)) for x, one in found]
        values, count = list(given), len(given)
        for name, place, converted in checks:
            if place < count:
                values[place] = converted(values[place])
            elif name in named:
                named[name] = converted(named[name])
        return thing(*values, **named)

    call.declared = partial(_declared, texts, thing.__globals__)  # type: ignore[attr-defined]
    return call  # type: ignore[return-value]


def declared(thing: Callable[..., Any]) -> dict[str, Declared]:
    """What the annotations of a checked function or class say of its arguments, by their names."""
    asked = thing.__init__ if isinstance(thing, type) else thing  # type: ignore[misc]
    return getattr(asked, "declared", dict)()


def _declared(texts: dict[str, Any], names: dict[str, Any]) -> dict[str, Declared]:
    found = {}
    for name, text in texts.items():
        try:
            hint = eval(text, names) if isinstance(text, str) else text
        except NameError:
            if ANNOTATED.search(text):
                raise
            continue
        one = _read(hint)
        if one is not None and name != "return":
            found[name] = one
    return found


def _read(hint: Any) -> Declared | None:
    """What an annotation says, or None where the body has to look at the value."""
    types = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    several = [one for one in types if one is not NoneType]
    if len(several) > 1:
        if any(get_origin(one) is Annotated for one in several):
            raise TypeError(f"{hint}: only one type can have bounds")
        return None
    (one,) = several
    kind, *said = get_args(one) if get_origin(one) is Annotated else (one,)
    if not (said or kind in (float, int, bool) or _is_asked(kind)):
        return None
    keywords: dict[str, Any] = {} if kind in CHECKS else {"wanted": kind}
    for word in said:
        sign, _, bound = word.partition(" ") if isinstance(word, str) else ("", "", "")
        if sign in BOUNDS:
            keywords[BOUNDS[sign]] = kind(bound)
        elif word == "or inf":
            keywords["finite"] = False
        else:
            keywords["unit" if isinstance(word, str) else "allowed"] = word
    return Declared(kind, keywords, len(types) > 1)


def _is_asked(kind: Any) -> bool:
    """Whether a type is a class whose instances are wanted, not a protocol or a type of Python."""
    ours = isinstance(kind, type) and kind.__module__.split(".")[0] not in sys.stdlib_module_names
    return ours and not getattr(kind, "_is_protocol", False)


def _plain(text: Any) -> Any:
    """An annotation without what only `checked` reads."""

    def plain(found: re.Match[str]) -> str:
        named = getattr(typing, found[2] or "", None)
        return found[1] or str(get_args(named)[0].__name__)

    return ANNOTATED.sub(plain, text) if isinstance(text, str) else text
