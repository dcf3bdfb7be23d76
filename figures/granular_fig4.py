"""The steel branch transmits its pulse four times as fast as the PTFE branch.

Fig. 4 of the paper: a single wave meets a steel and a PTFE branch.
"""

from __future__ import annotations

from figures import _guide
from figures._guide import PTFE, STEEL, row
from granular import diamond_guide
from tensegrity import peaks, speed

NAME = "granular_fig4"
GROUP = "granular"

DIVISIONS = (2.0, 2.0, 0.4, 2.0)  # N, of the paper's runs
END = 2.4e-3  # s
BEADS = (7, 15)  # of a branch, between which speeds are taken


def data(by=1.0):
    """Curves, density along the PTFE branch, energies; speeds of the leading pulses.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PTFE), striker=_guide.light(0.20 * by))
    run = _guide.followed(guide, END)
    tables = _guide.scene_tables(run, _guide.MIXED, 2)
    before = {"branch 1": (0, 0.4e-3), "branch 2": (0, 1.0e-3)}  # anything returns
    for part, window in before.items():
        tables["numbers"][f"speed in {part} [m/s]"] = [speed(run, part, BEADS, window)]
    return tables


def table(tables):
    """The statements of the paper and the numbers of the run."""
    steel, ptfe = (_guide.number(tables, f"speed in branch {k} [m/s]") for k in (1, 2))
    there, back = peaks(*_guide.curve(tables, "branch 1", 7), 0.2)[1][:2]
    lines = [
        row("4", "speed in the steel branch over that in the PTFE branch", steel / ptfe,
            "about 4", "about 4"),
        row("4", "pulse back from the 120 deg bend at bead 7 of the steel branch, over the first",
            float(back / there), "small"),
    ]  # fmt: skip
    lines += _guide.soft_shares("4", tables, "the PTFE branch")
    return lines + _guide.balances("4", tables)


def draw(figure, tables):
    """Curves and density."""
    figure.set_size_inches(9, 5)
    titles = ("steel and PTFE branch, 0.45 g at 0.20 m/s", "stem 1, PTFE branch, stem 2")
    _guide.draw_scene(figure, figure.subplots(1, 2), tables, DIVISIONS, titles)
