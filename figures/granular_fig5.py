"""A Parylene branch retains a train of pulses for milliseconds.

Fig. 5 of the paper: a single wave meets a steel and a Parylene-C coated branch.
"""

from __future__ import annotations

from figures import _guide
from figures._guide import PARYLENE, STEEL, row
from granular import diamond_guide
from tensegrity import peaks

NAME = "granular_fig5"
GROUP = "granular"

DIVISIONS = (5.0, 5.0, 1.25, 2.5)  # N, of the paper's runs
END = 2.4e-3  # s
RETURN = 0.6e-3  # s: later, pulses return from the bend


def data(by=1.0):
    """Curves, density along the Parylene branch, energies.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=_guide.light(0.50 * by))
    return _guide.scene_tables(_guide.followed(guide, END), _guide.MIXED, 2)


def table(tables):
    """The statements of the paper and the numbers of the run."""
    t, force = _guide.curve(tables, "branch 2", 7)
    early = t < RETURN
    heights = peaks(t[early], force[early], 0.05)[1]
    lines = [
        row("5", "pulses above 5 % in the Parylene branch, bead 7, until returns", len(heights),
            "not shown", "about 4"),
        row("5", "second of them over the first", float(heights[1] / heights[0])),
        *_guide.soft_overlaps("5", tables, "order of 2"),
    ]  # fmt: skip
    lines += _guide.soft_shares("5", tables, "that branch")
    return lines + _guide.balances("5", tables)


def draw(figure, tables):
    """Curves and density."""
    figure.set_size_inches(9, 5)
    titles = ("steel and Parylene branch, 0.45 g at 0.50 m/s", "stem 1, Parylene branch, stem 2")
    _guide.draw_scene(figure, figure.subplots(1, 2), tables, DIVISIONS, titles)
