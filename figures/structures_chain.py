"""Where a chain of condensed prisms represents a column: axial waves of columns with all nodes.

Each wave of the endless columns is a point, as large as the part of its energy that is axial motion
of whole triangles with one phase from unit to unit.  The line is the chain with the mass of a
triangle at each site.
Source: the talk, part III, "chains of tensegrity prisms".
"""

import numpy as np
from scipy.optimize import brentq

from tensegrity import Prism, bands, dispersion, moduli

GROUP = "structures"

PRISM = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0)
HANDS = {"alternate": "alternating hands", "same": "one hand"}
PHASES = np.linspace(0.02, np.pi, 120)  # from unit to unit [rad]
HIGHEST = 2.2  # rad/s
LEAST = 0.02  # part of a wave that is drawn
ERROR = 0.01


def chain(phases):
    """Frequencies of the chain [rad/s]."""
    spring = PRISM.potential()
    return dispersion(spring, PRISM.sides, np.asarray(phases, float))[:, 0]


def waves(column, phases):
    """Frequencies [rad/s] and axial parts of the waves at phases per unit, (phases, waves)."""
    units = column.nodes // PRISM.sides
    found = bands(column, (units * phases)[:, None], shapes=True)
    along = found.shapes[:, :, :, 2].reshape(len(phases), -1, units, PRISM.sides).sum(axis=3)
    turned = np.exp(-1j * phases[:, None] * np.arange(units))
    part = np.abs(np.einsum("pwu,pu->pw", along, turned)) ** 2 / column.nodes
    return found.frequencies, part


def axial(column, phase):
    """Frequency of the wave with the largest axial part [rad/s]."""
    w, part = waves(column, np.array([phase]))
    return float(w[0, part[0].argmax()])


def exact_until():
    """Phase per unit at which the alternating column is `ERROR` below the chain."""
    column = PRISM.column(periodic=True)
    return brentq(lambda q: axial(column, q) / chain([q])[0] - 1 + ERROR, 0.02, 0.5)


def data():
    tables = {"chain": {"phase": PHASES, "frequency": chain(PHASES)}}
    for hand in HANDS:
        w, part = waves(PRISM.column(chirality=hand, periodic=True), PHASES)
        shown = (part > LEAST) & (w < HIGHEST)
        rows = np.nonzero(shown)[0]
        tables[hand] = {"phase": PHASES[rows], "frequency": w[shown], "axial part": part[shown]}
    return tables


def draw(figure, tables):
    figure.set_size_inches(9.4, 4.2)
    panels = figure.subplots(1, 2, sharey=True)
    for ax, hand in zip(panels, HANDS, strict=True):
        q, w, part = tables[hand].values()
        ax.scatter(q, w, s=30 * part, c="C0", lw=0)
        ax.plot(*tables["chain"].values(), "C3", lw=1.2)
        ax.annotate("chain", (2.2, 1.42), color="C3")
        ax.set(xlabel="phase from unit to unit [rad]", ylim=(0, HIGHEST), xlim=(0, np.pi))
    panels[0].set(
        ylabel="frequency [rad/s]", title="Alternating hands: the chain holds for long waves"
    )
    panels[1].set_title("One hand: axial waves are torsional too")


def table(tables):
    speed = float(PRISM.height * np.sqrt(PRISM.axial_stiffness() / PRISM.sides))
    for hand, words in HANDS.items():
        slow, fast = moduli(PRISM.column(chirality=hand, periodic=True)).speeds([0, 0, 1])[2:]
        yield {"column": words, "slower [m/s]": float(slow), "faster [m/s]": float(fast),
               "chain [m/s]": speed}  # fmt: skip
    q, words = exact_until(), f"alternating hands, {ERROR:.0%} below the chain at a phase of"
    yield {"column": words, "units a wave": float(2 * np.pi / q), "phase": float(q)}
