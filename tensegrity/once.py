"""What all threads share is built once: compiled kernels, CasADi functions, derived expressions.

Two expressions belong together only if they hold the same symbols, so a builder must not run
twice at a time, and one builder's parts must not come from another's second run.  What is built
already is handed out without waiting.
"""

from __future__ import annotations

import os
import threading
from functools import wraps

from tensegrity.typing import Function

_lock = threading.RLock()


def once(build: Function) -> Function:
    """A function that keeps its results, as `functools.cache` does, and is run by one thread
    at a time: never twice with the same arguments, never beside another such function."""
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


if hasattr(os, "register_at_fork"):  # the thread that holds it does not come along
    os.register_at_fork(after_in_child=_renew)
