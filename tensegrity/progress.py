"""Progress bars, of which nothing is seen or imported where nobody looks."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any


def progress(total: int, unit: str) -> Any:
    """A bar of tqdm as a context, from the first second on; outside a terminal one that is still.

    To import tqdm takes as long as all of a short run.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        return nullcontext(SimpleNamespace(n=0, update=lambda done: None))
    from tqdm import tqdm

    return tqdm(total=total, unit=unit, unit_scale=True, delay=1.0, leave=False)
