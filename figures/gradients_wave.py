"""Every prism that a wave has crossed shifts its passage alike, those ahead not at all.

A solitary wave travels along a chain of equal prisms.  The passage time is that at which a site
reaches half of its final displacement; one backward pass gives its derivatives with respect to
every prism.  Prisms that the wave has crossed contribute almost equally, those beyond the site
nothing.  The sum is the derivative by a common prestrain, which two further runs confirm.
"""

from __future__ import annotations

import numpy as np

from figures import _gradients
from tensegrity import Chain, Prism, gradient, solitary_wave
from tensegrity import objective as o

NAME = "gradients_wave"
GROUP = "gradients"

SITES, AT, SITE, RATIO = 120, 25, 80, 1.5
PRESTRAIN, STEP = 0.02, 1e-5
DT, METHOD = 0.2, "rkn6"


def passage(prestrain, wave=None):
    """The gradient of the time of passage in a chain of one prestrain, by the given wave."""
    spring = Prism(1.0, 0.7, prestrain, 1.0).potential()
    chain = Chain(spring, SITES)
    wave = solitary_wave(spring, mass=1.0, speed_ratio=RATIO) if wave is None else wave
    state = wave.launch(Chain(Prism(1.0, 0.7, PRESTRAIN, 1.0).potential(), SITES), at=AT)
    t_end = 1.4 * (SITE - AT) / wave.speed
    half = (state.u[0] + state.u[-1]) / 2
    return gradient(o.arrival(SITE, half), chain, state, t_end, dt=DT, method=METHOD), wave


def data():
    """Derivatives by each prism, and the check by two more chains under the same start."""
    found, wave = passage(PRESTRAIN)
    low, high = (passage(PRESTRAIN + x, wave)[0].value for x in (-STEP, STEP))
    by = {name: found.by(name) for name in ("prestrain", "height", "k_cross")}
    values = {
        "passage of the site [s]": found.value,
        "speed of the wave [sites/s]": wave.speed,
        "sum of the derivatives by prestrain [s]": by["prestrain"].sum(),
        "difference of two chains [s]": (high - low) / (2 * STEP),
        "digits unaffected by round-off": found.digits,
    }
    return {
        "bonds": {"bond": np.arange(SITES - 1), **by},
        "numbers": _gradients.numbers(values),
    }


def table(tables):
    """The numbers that are printed."""
    return _gradients.lines(NAME, tables)


def draw(figure, tables):
    """Derivatives of the time of passage by each prism."""
    figure.set_size_inches(8, 6.5)
    bonds = tables["bonds"]
    units = {"prestrain": ("prestrain", "s"), "height": ("height", "s/m"),
             "k_cross": ("cross stiffness", "s m/N")}  # fmt: skip
    panels = figure.subplots(3, 1, sharex=True)
    for axes, (name, (words, unit)) in zip(panels, units.items(), strict=True):
        axes.plot(bonds["bond"], bonds[name], ".-", ms=3, lw=0.8)
        axes.axvline(AT, color="0.5", ls=":", lw=0.8)
        axes.axvline(SITE, color="0.5", ls=":", lw=0.8)
        axes.set_ylabel(f"by {words}\n[{unit}]")
    panels[0].set_title(
        f"(a) derivative of the time at site {SITE}; the wave starts at bond {AT} (dotted)",
        fontsize=10,
    )
    panels[-1].set_xlabel("bond")
