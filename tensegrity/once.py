"""A cache for objects shared by all threads: compiled kernels, CasADi functions, expressions.

Two expressions are compatible only if they hold the same symbols.  So no builder may run twice at
the same time, nor use parts that another builder made in a second run.  Objects that exist are
returned without waiting.
"""

from __future__ import annotations

import os
import threading
from functools import wraps

from tensegrity.typing import Function

_lock = threading.RLock()


def once(build: Function) -> Function:
    """A function that caches its results, as `functools.cache` does, and is run by one thread at a
    time: never twice with the same arguments, and never together with another such function."""
    made = {}

    @wraps(build)
    def get(*arguments):
        try:
            return made[arguments]
        except KeyError:
            pass
        with _lock:
            if arguments not in made:
                made[arguments] = build(*arguments)
            return made[arguments]

    return get  # type: ignore[return-value]


def _renew():
    global _lock
    _lock = threading.RLock()


if hasattr(os, "register_at_fork"):  # the thread that holds the lock is not forked
    os.register_at_fork(after_in_child=_renew)
