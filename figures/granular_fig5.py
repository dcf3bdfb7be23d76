"""A Parylene branch retains a train of pulses for milliseconds.

Fig. 5 of the paper: a single wave meets a steel and a Parylene-C coated branch.
"""

from figures import _guide
from tensegrity import peaks

NAME = "granular_fig5"
GROUP = "granular"

RETURN = 0.6e-3  # s: later, pulses return from the bend


def data(by=1.0):
    """Curves, density along the Parylene branch, energies.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    run = _guide.mixed(_guide.PARYLENE, _guide.light(0.50 * by))
    return _guide.scene_tables(run, _guide.MIXED, 2)


def table(tables):
    """The statements of the paper and the numbers of the run."""
    heights = peaks(*_guide.curve(tables, "branch 2", 7, RETURN), 0.05)[1]
    lines = {
        "pulses above 5 % in the Parylene branch, bead 7, until returns":
        (len(heights), "not shown", "about 4"),
        "second of them over the first": heights[1] / heights[0],
    }  # fmt: skip
    return _guide.rows("5", lines) + _guide.soft_lines("5", tables, "that branch", "order of 2")


def draw(figure, tables):
    """Curves and density."""
    _guide.draw_mixed(figure, tables, (5.0, 5.0, 1.25, 2.5), "Parylene", "0.45 g at 0.50 m/s")
