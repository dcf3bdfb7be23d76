"""The chart of a benchmark as PNG, and its rows as CSV."""

from __future__ import annotations

from contextlib import contextmanager

from figures.__main__ import OUTPUT
from figures._draw import STYLE
from figures._files import write, write_table

FOLDER = OUTPUT / "benchmarks"


@contextmanager
def charted(name, folder, columns, rows, **size):
    """A figure to draw in, written at the end; and the paths of the picture and of the table."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    picture, data = (folder / f"benchmark_{name}.{kind}" for kind in ("png", "csv"))
    folder.mkdir(parents=True, exist_ok=True)
    write_table(data, dict(zip(columns, zip(*rows, strict=True), strict=True)))
    with plt.rc_context(STYLE):
        figure = plt.figure(layout="constrained", **size)
        yield figure, (picture, data)
        write(picture, figure.savefig)
        plt.close(figure)
