"""A cache for objects shared by all threads: compiled kernels, CasADi functions, expressions.

Two expressions are compatible only if they hold the same symbols, so no object may be built twice
at the same time.  Each has a lock of its own: different objects are built at the same time, and
those that exist are returned without waiting.  Builders call one another without cycles, so that
no two threads wait for each other.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

from tensegrity.typing import Function

SIZE = 1024  # results of one function; beyond these the oldest are discarded
_caches: list[dict[Any, _Entry]] = []


@contextmanager
def undisturbed() -> Iterator[None]:
    """Ctrl-C waits until the end of some calls of CasADi.

    CasADi converts arguments by calls of Python, and drops a KeyboardInterrupt that is raised in
    one of them, or raises another error in its place.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    pressed: list[tuple[Any, ...]] = []
    signal.signal(signal.SIGINT, lambda *given: pressed.append(given))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if pressed:
            before(*pressed[0])


class _Entry:
    """A result, which has no `value` before it is built."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.value: Any

    def built(self) -> bool:
        return hasattr(self, "value")


def once(build: Function) -> Function:
    """A function that caches its last `SIZE` results, and whose result for given arguments is
    built by one thread while others wait for it."""
    made: dict[Any, _Entry] = {}
    _caches.append(made)

    @wraps(build)
    def get(*arguments):
        entry = made.get(arguments)
        if entry is None:
            entry = made.setdefault(arguments, _Entry())
            if len(made) > SIZE:
                oldest, *_ = made  # one instruction, during which no other thread runs
                made.pop(oldest, None)
        if not entry.built():
            with entry.lock:
                if not entry.built():
                    entry.value = build(*arguments)
        return entry.value

    get.cache_clear = made.clear  # type: ignore[attr-defined]  # as of functools.cache
    return get  # type: ignore[return-value]


def _forget_unfinished():
    for made in _caches:
        for arguments, entry in list(made.items()):
            if not entry.built():
                del made[arguments]


if hasattr(os, "register_at_fork"):  # a thread that builds is not forked
    os.register_at_fork(after_in_child=_forget_unfinished)
