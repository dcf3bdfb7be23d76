"""Progress bars, in a terminal and in a notebook; tqdm is imported only when one is drawn."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _Call:
    """The one bar of a call, which everything counted in its unit adds to.

    Attributes
    ----------
    bar : tqdm or None
        None until something is counted: to import tqdm takes as long as all of a short run.
    """

    def __init__(self, unit: str) -> None:
        self.unit, self.thread, self.bar = unit, threading.get_ident(), None

    def serves(self, unit: str) -> bool:
        """Whether what is counted in this unit, here, shows on this bar."""
        return unit == self.unit and self.thread == threading.get_ident()


class _Counter:
    """What counts one part of a call: `n` of `total` units, shown on the bar of the call."""

    def __init__(self, total: int, done: int, bar: Any = None) -> None:
        self.total, self.n, self._bar = total, done, bar

    def update(self, more: int = 1) -> None:
        """Count more."""
        self.n += more
        if self._bar is not None:
            self._bar.update(more)


_calls: list[_Call] = []  # of this process: one, or none


@contextmanager
def one_bar(unit: str) -> Iterator[None]:
    """A context in which all that `progress` counts in this unit is one bar.

    Within the context of another call it does nothing: the outermost call has the bar.  At the end
    the bar is set to full, even after an interruption, and cleared.
    """
    if _calls or not _is_watched():
        yield
        return
    call: Any = _Call(unit)
    _calls.append(call)
    try:
        yield
    finally:
        _calls.remove(call)
        if call.bar is not None:
            call.bar.close()


@contextmanager
def progress(total: int, unit: str, done: int = 0) -> Iterator[_Counter]:
    """A bar of tqdm as a context, from the first second on, in a terminal or a notebook; anywhere
    else one that is still, and so within a call that has a bar of another unit.

    Parameters
    ----------
    total, done : int
        Number of units in all, and of those done before.
    unit : str

    Yields
    ------
    counter
        With `update(count)`, and `n`, the number of units done.
    """
    with one_bar(unit):
        call: Any = next((call for call in _calls if call.serves(unit)), None)
        if call is None:
            yield _Counter(total, done)
            return
        if call.bar is None:
            call.bar = _bar(unit, done)
        else:
            call.bar.update(done)
        call.bar.total += total
        counter = _Counter(total, done, call.bar)
        try:
            yield counter
        finally:
            call.bar.total -= total - counter.n  # what was broken off is not waited for


def _is_watched() -> bool:
    """Whether a bar is visible: not in a worker process, nor in a file."""
    if multiprocessing.parent_process() is not None:
        return False
    return in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


def _bar(unit: str, done: int) -> Any:
    if in_notebook():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without widgets the bar is text
            from tqdm.auto import tqdm
    else:
        from tqdm import tqdm

    return tqdm(total=0, initial=done, unit=unit, unit_scale=True, delay=1.0, leave=False)


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return "IPKernelApp" in getattr(shell, "config", {})
