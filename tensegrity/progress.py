"""Progress bars, of which nothing is seen or imported where nobody looks."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any


def progress(total: int, unit: str, done: int = 0) -> Any:
    """A bar of tqdm as a context, from the first second on; outside a terminal one that is still.

    Parameters
    ----------
    total, done : int
        Units in all, and those that were there before.
    unit : str

    Notes
    -----
    To import tqdm takes as long as all of a short run.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        return nullcontext(SimpleNamespace(n=done, total=total, update=lambda more=1: None))
    from tqdm import tqdm

    return tqdm(total=total, initial=done, unit=unit, unit_scale=True, delay=1.0, leave=False)
