"""Progress bars, of which nothing is seen or imported where nobody looks."""

from __future__ import annotations

import sys
import warnings
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any


def progress(total: int, unit: str, done: int = 0) -> Any:
    """A bar of tqdm as a context, from the first second on, in a terminal or a notebook; anywhere
    else one that is still.

    Parameters
    ----------
    total, done : int
        Units in all, and those that were there before.
    unit : str

    Notes
    -----
    To import tqdm takes as long as all of a short run.
    """
    notebook = in_notebook()
    if not notebook and (sys.stderr is None or not sys.stderr.isatty()):
        return nullcontext(SimpleNamespace(n=done, total=total, update=lambda more=1: None))
    if notebook:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # no widgets: a bar of text then
            from tqdm.auto import tqdm
    else:
        from tqdm import tqdm

    return tqdm(total=total, initial=done, unit=unit, unit_scale=True, delay=1.0, leave=False)


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return "IPKernelApp" in getattr(shell, "config", {})
