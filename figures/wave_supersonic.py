"""A wave far above the sound speed, emerging from an impact, against the tent profile."""

from __future__ import annotations

from figures import _impact
from tensegrity import Prism

NAME = "wave_supersonic"
GROUP = "waves"

PRISM = Prism(base=1.0, height=0.6, prestrain=0.001, k_cross=1.0)
RATIO = 12.16


def data():
    """Profile of the leading pulse at 12.16 times the speed of sound, and its asymptotics."""
    how = {"struck": 1, "sites": 60, "travel": 48, "bracket": (0.155, 0.165), "around": 4}
    return _impact.comparison(PRISM.potential(), RATIO, **how)


def draw(figure, tables):
    """Profile and numbers."""
    axes = figure.subplots(1, 2, width_ratios=(3, 1.25))
    _impact.draw(*axes, tables, f"c = {RATIO} c$_s$, height 0.6 m, prestrain 0.001")
