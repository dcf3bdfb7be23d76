"""A train reaches stem 2 twice: at 0.6 ms through steel, at 1.3 ms through Parylene.

Fig. 6 of the paper: a train of waves meets a steel and a Parylene-C coated branch.
"""

from figures import _guide
from tensegrity import peaks

NAME = "granular_fig6"
GROUP = "granular"

QUIET = 1.0e-3  # s: by then the train of the steel branch has passed
RETURN = 0.75e-3  # s: later, pulses return from the bend


def data(by=1.0):
    """Curves, density along the Parylene branch, energies.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    run = _guide.mixed(_guide.PARYLENE, _guide.heavy(0.35 * by))
    return _guide.scene_tables(run, _guide.MIXED, 2)


def table(tables):
    """The statements of the paper and the numbers of the run."""
    found = peaks(*_guide.curve(tables, "stem 2", 5), 0.3)[0]
    pulses = peaks(*_guide.curve(tables, "branch 2", 7, RETURN), 0.1)[1]
    lines = {
        "first arrival at bead 5 of stem 2 [ms]": (1e3 * found[0], 0.6, 0.6),
        "arrival from the Parylene branch there [ms]": (1e3 * found[found > QUIET][0], 1.4, 1.4),
        "pulses above 10 % in the Parylene branch, bead 7, until returns":
        (len(pulses), "a train", "a train"),
    }  # fmt: skip
    return _guide.rows("6", lines) + _guide.soft_lines("6", tables, "that branch", "order of 5")


def draw(figure, tables):
    """Curves and density."""
    _guide.draw_mixed(figure, tables, (10.0, 10.0, 10.0, 5.0), "Parylene", "5.33 g at 0.35 m/s")
