"""The steel branch transmits its pulse four times as fast as the PTFE branch.

Fig. 4 of the paper: a single wave meets a steel and a PTFE branch.
"""

from figures import _guide
from tensegrity import peaks, speed

NAME = "granular_fig4"
GROUP = "granular"


def data(by=1.0):
    """Curves, density along the PTFE branch, energies; speeds of the leading pulses.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    run = _guide.mixed(_guide.PTFE, _guide.light(0.20 * by))
    tables = _guide.scene_tables(run, _guide.MIXED, 2)
    for part, until in (("branch 1", 0.4e-3), ("branch 2", 1.0e-3)):  # before anything returns
        tables["numbers"][f"speed in {part} [m/s]"] = [speed(run, part, (7, 15), (0, until))]
    return tables


def table(tables):
    """The statements of the paper and the numbers of the run."""
    steel, ptfe = (_guide.number(tables, f"speed in branch {k} [m/s]") for k in (1, 2))
    there, back = peaks(*_guide.curve(tables, "branch 1", 7), 0.2)[1][:2]
    lines = {
        "speed in the steel branch over that in the PTFE branch":
        (steel / ptfe, "about 4", "about 4"),
        "pulse back from the 120 deg bend at bead 7 of the steel branch, over the first":
        (back / there, "small"),
    }  # fmt: skip
    return _guide.rows("4", lines) + _guide.soft_lines("4", tables, "the PTFE branch")


def draw(figure, tables):
    """Curves and density."""
    _guide.draw_mixed(figure, tables, (2.0, 2.0, 0.4, 2.0), "PTFE", "0.45 g at 0.20 m/s")
