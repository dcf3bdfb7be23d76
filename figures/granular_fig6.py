"""A train reaches stem 2 twice: at 0.6 ms through steel, at 1.3 ms through Parylene.

Fig. 6 of the paper: a train of waves meets a steel and a Parylene-C coated branch.
"""

from __future__ import annotations

import numpy as np

from figures import _guide
from figures._guide import PARYLENE, STEEL, row
from granular import diamond_guide
from tensegrity import peaks

NAME = "granular_fig6"
GROUP = "granular"

DIVISIONS = (10.0, 10.0, 10.0, 5.0)  # N, of the paper's runs
END = 2.4e-3  # s
QUIET = 1.0e-3  # s: by then the train of the steel branch has passed
RETURN = 0.75e-3  # s: later, pulses return from the bend


def data(by=1.0):
    """Curves, density along the Parylene branch, energies.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=_guide.heavy(0.35 * by))
    return _guide.scene_tables(_guide.followed(guide, END), _guide.MIXED, 2)


def table(tables):
    """The statements of the paper and the numbers of the run."""
    t, force = _guide.curve(tables, "stem 2", 5)
    found = peaks(t, force, 0.3)[0]
    second = found[np.flatnonzero(found > QUIET)[0]]
    t_branch, in_branch = _guide.curve(tables, "branch 2", 7)
    early = t_branch < RETURN
    lines = [
        row("6", "first arrival at bead 5 of stem 2 [ms]", float(1e3 * found[0]), 0.6, 0.6),
        row("6", "arrival from the Parylene branch there [ms]", float(1e3 * second), 1.4, 1.4),
        row("6", "pulses above 10 % in the Parylene branch, bead 7, until returns",
            len(peaks(t_branch[early], in_branch[early], 0.1)[1]), "a train", "a train"),
        *_guide.soft_overlaps("6", tables, "order of 5"),
    ]  # fmt: skip
    lines += _guide.soft_shares("6", tables, "that branch")
    return lines + _guide.balances("6", tables)


def draw(figure, tables):
    """Curves and density."""
    figure.set_size_inches(9, 5)
    titles = ("steel and Parylene branch, 5.33 g at 0.35 m/s", "stem 1, Parylene branch, stem 2")
    _guide.draw_scene(figure, figure.subplots(1, 2), tables, DIVISIONS, titles)
