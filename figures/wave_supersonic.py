"""A wave far above the sound speed, emerging from an impact, against the tent profile."""

from __future__ import annotations

from figures import _impact, _measure, _scenes
from figures.wave_speeds import WAVES

NAME = "wave_supersonic"
GROUP = "waves"

RATIO = 12.16


def data():
    """Profiles at 12.16 times the speed of sound, and their numbers."""
    prism, how = WAVES[RATIO]
    return _impact.comparison(_scenes.rigid(*prism), RATIO, **how)[0]


def draw(figure, tables):
    """Profiles and numbers."""
    axes, side = figure.subplots(1, 2, width_ratios=(3, 1.3))
    _impact.draw(axes, tables, f"c = {RATIO} c$_s$, height 0.6 m, prestrain 0.001")
    axes.legend(loc="upper right", fontsize=8)
    side.axis("off")
    numbers = _measure.from_table(tables["numbers"])
    lines = [f"{name}\n    {n.value:.6g} ± {n.error:.0e}" for name, n in numbers.items()]
    side.text(0, 1, "\n".join(lines), va="top", fontsize=8, transform=side.transAxes)
