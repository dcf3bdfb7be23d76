"""An exact gradient of a chaotic motion is useless after five milliseconds.

Forty steel beads of 10 mm touch each other and a wall at either end; the first starts at 1 m/s.
The derivative of the energy of the first half with respect to the initial state is computed for
increasing durations.  It is exact for each run and grows with time as any error does: once its
product with round-off reaches the value itself, neither value nor derivative carries information
about the beads.
"""

from __future__ import annotations

import numpy as np

from granular import Bead, hertz, materials
from tensegrity import Chain, gradient
from tensegrity import objective as o

NAME = "gradients_chaos"
GROUP = "gradients"

STEEL = materials["steel"]
BEAD, COUNT, SPEED = Bead(10e-3, STEEL), 40, 1.0
TIMES = 1e-3 * np.array([0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0])  # s
DT = 2e-7


def scene():
    """The beads, held sites for the walls before and behind them."""
    inner, wall = hertz(BEAD, BEAD).spring(), hertz(BEAD, STEEL).spring()
    springs = [wall, *[inner] * (COUNT - 1), wall]
    return Chain(springs, COUNT + 2, [1.0, *[BEAD.mass] * COUNT, 1.0], ("fixed", "fixed"))


def data():
    """For each duration the largest derivatives, the digits left, and the reversed run."""
    beads = scene()
    state = beads.at_rest({1: SPEED})
    half = o.energy(range(1, 1 + COUNT // 2))
    rows = [gradient(half, beads, state, t, dt=DT, wanted=("stiffness",)) for t in TIMES]
    return {
        "durations": {
            "t": TIMES,
            "energy": [g.value for g in rows],
            "largest by a velocity at the start": [np.abs(g.v).max() for g in rows],
            "largest by a displacement at the start": [np.abs(g.u).max() for g in rows],
            "digits": [g.digits for g in rows],
            "reversal": [g.reversal for g in rows],
        }
    }


def table(tables):
    """One line per duration."""
    rows = tables["durations"]
    return [
        {"picture": NAME, "quantity": f"digits left, largest dE/dv0 [J s/m] at {1e3 * t:g} ms",
         "value": f"{digits:.2f}, {by:.3g}"}
        for t, digits, by in zip(rows["t"], rows["digits"],
                                 rows["largest by a velocity at the start"], strict=True)
    ]  # fmt: skip


def draw(figure, tables):
    """The growth of the derivative, and the digits unaffected by round-off."""
    figure.set_size_inches(9, 4)
    left, right = figure.subplots(1, 2)
    rows = tables["durations"]
    t = 1e3 * np.asarray(rows["t"])
    left.semilogy(t, rows["largest by a velocity at the start"], "o-")
    left.set(xlabel="duration of the run [ms]", ylabel="largest |dE/dv0| [J s/m]")
    right.plot(t, rows["digits"], "o-")
    right.set(
        xlabel="duration of the run [ms]", ylabel="digits unaffected by round-off", ylim=(0, 16)
    )


def text(tables):
    """A section of the page on gradients."""
    rows = tables["durations"]
    first, last = rows["digits"][0], rows["digits"][-1]
    by = rows["largest by a velocity at the start"][-1]
    return (
        f"After a run of {1e3 * rows['t'][0]:g} ms, {first:.1f} digits of the energy of the first "
        f"half of the beads are free of round-off, after {1e3 * rows['t'][-1]:g} ms {last:.1f}; "
        f"there the derivative by an initial velocity reaches {by:.2g} J s/m. Both gradients are "
        "exact for the computed numbers. The second is useless: a design changed along it follows "
        "an entirely different trajectory. `digits` reports this with every gradient and should be "
        "checked before a step is taken. The remedy is a "
        "shorter window or a norm over many runs, not a smaller time step."
    )
