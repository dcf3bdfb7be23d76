"""Between heavy plates twist travels with extension, or drains the wave of the chain.

Plates that move and turn are the model between the chain and the column of nodes.  In columns of
one handedness extension and twist propagate together, in waves of permanent form too; in an
alternating column the wave of the chain of condensed prisms, launched without twist, gradually
loses its energy to torsion.
Source: the talk, part III, "chains of tensegrity prisms", where plates have no rotary inertia.
"""

import numpy as np

from figures._tables import arrays
from figures.structures_chain import HANDS, LEAST, PRISM, chain, waves
from tensegrity import Chain, Record, State, bands, simulate, solitary_wave

GROUP = "structures"

MASS, GYRATION = 3.0, PRISM.circumradius  # of the nodes of a polygon, 1 kg each
PLATES = MASS, GYRATION
PHASES = np.linspace(0.02, np.pi, 80)  # from unit to unit [rad]
HIGHEST = 4.2  # rad/s
WAVES = 40.0, 20.0, 10.0  # units a wave
KINDS = "alternating", "one handedness"
BRANCHES = [f"{KINDS[0]}, {x}" for x in ("torsional", "axial")]
BRANCHES += [f"{KINDS[1]}, {x}" for x in ("slow", "fast")]
RATIO = 1.1  # of the speed to that of the faster sound
POINTS = np.arange(-64, 65) / 8  # units from the peak
UNITS, START, TRAVEL = 200, 30, 140
LONG, SHED = 220, 120  # units of the alternating column, and of travel in it
TOLERANCES = (1e-5, 1e-8)
NEAR = 10  # units on either side of the peak that belong to the wave
GYRATIONS = {"as of the nodes": 1.0, "0.3 of it": 0.3}


def nearest(column, phases, frequencies):
    """Of the waves of a column at phases per unit those nearest to frequencies, of each."""
    units = column.nodes // PRISM.sides
    w = bands(column, (units * np.asarray(phases))[:, None]).frequencies
    return np.take_along_axis(w, np.abs(w - frequencies[:, None]).argmin(axis=1)[:, None], 1)[:, 0]


def plates(phases, hand="same"):
    """Frequencies of the two slowest waves of plates at phases per unit, (phases, 2)."""
    column = PRISM.column(chirality=hand, plates=PLATES, periodic=True)
    return bands(column, (column.nodes * np.asarray(phases))[:, None]).frequencies[:, :2]


def errors(hand, units):
    """Relative errors of the two slowest waves of plates, `units` a wave."""
    q = np.full(2, 2 * np.pi / units)
    w = plates(q[:1], hand)[0]
    return w / nearest(PRISM.column(chirality=hand, periodic=True), q, w) - 1


def permanent():
    """The wave of one handedness, and its state in a column."""
    column = PRISM.column(UNITS, "same", plates=PLATES)
    wave = solitary_wave(column, speed_ratio=RATIO)
    return wave, wave.launch(column, at=START + 0.5)


def travelled(tolerance, speed, state):
    """Differences after the travel, and what is off and left behind over the peak."""
    column = PRISM.column(UNITS, "same", plates=PLATES)
    end = simulate(column, state, TRAVEL / speed, tol=tolerance).final
    first, last = np.diff(state.u, axis=0), np.diff(end.u, axis=0)
    peak = np.abs(first).max()
    off = np.abs(last[TRAVEL:] - first[:-TRAVEL]).max() / peak
    return last, off, np.abs(last[: TRAVEL - NEAR]).max() / peak


def shed(part, tolerance):
    """Units travelled by the wave of the chain among alternating plates, and share of the energy
    that is near its peak."""
    wave = solitary_wave(PRISM.potential(), MASS, speed_ratio=1.05)
    state = wave.launch(Chain(wave.potential, LONG + 1, MASS), at=40.5)
    u, v = (np.column_stack([x, np.zeros(LONG + 1)]) for x in (state.u, state.v))
    column = PRISM.column(LONG, plates=(MASS, part * GYRATION))
    record = Record(interval=10 / wave.speed)
    run = simulate(column, State(u, v), SHED / wave.speed, tol=tolerance, record=record)
    energy = column.site_energy(run)
    peaks = np.diff(run.u[:, :, 0], axis=1).argmin(axis=1)
    near = [e[max(p - NEAR, 0) : p + NEAR + 2].sum() for e, p in zip(energy, peaks, strict=True)]
    return peaks - peaks[0], np.array(near) / energy.sum(axis=1)


def data():
    every, part = waves(PRISM.column(chirality="same", periodic=True), PHASES)
    rows = np.nonzero((part > LEAST) & (every < HIGHEST))
    tables = {"bands": {"phase": PHASES, "chain": chain(PHASES)}}
    tables["bands"] |= dict(zip(("slow", "fast"), plates(PHASES).T, strict=True))
    tables["nodes"] = {"phase": PHASES[rows[0]], "frequency": every[rows]}
    wave, state = permanent()
    tables["wave"] = {"x": POINTS}
    tables["wave"] |= dict(zip(("extension", "twist"), wave.elongation(POINTS).T, strict=True))
    found = []
    for tolerance in TOLERANCES:
        last, off, behind = travelled(tolerance, wave.speed, state)
        found.append({"tolerance": tolerance, "off": off, "behind": behind,
                      "residual": wave.residual, "speed": wave.speed})  # fmt: skip
    tables["travel"] = arrays(found)
    near = last[START + TRAVEL - 8 : START + TRAVEL + 9]
    tables["after"] = {"x": np.arange(-8, 9), "extension": near[:, 0], "twist": near[:, 1]}
    for name, part in GYRATIONS.items():
        loose, tight = (shed(part, tolerance) for tolerance in TOLERANCES)
        tables[name] = {"units": tight[0], "share": tight[1], "loose": loose[1]}
    off = np.concatenate([[errors(hand, units) for units in WAVES] for hand in HANDS], axis=1)
    tables["models"] = {"units a wave": WAVES} | dict(zip(BRANCHES, off.T, strict=True))
    return tables


def draw(figure, tables):
    """Bands of one handedness, its wave, and the wave of the chain among alternating plates."""
    figure.set_size_inches(12, 4.2)
    left, middle, right = figure.subplots(1, 3)
    of = tables["bands"]
    left.plot(*tables["nodes"].values(), ".", color="0.6", ms=4)
    for branch in ("slow", "fast"):
        left.plot(of["phase"], of[branch], "C0")
    left.plot(of["phase"], of["chain"], "C3--")
    left.annotate("column of nodes", (1.9, 2.4), color="0.5")
    left.annotate("plates", (0.75, 2.6), color="C0")
    left.annotate("chain", (2.3, 1.25), color="C3")
    left.set(xlabel="phase from unit to unit [rad]", ylabel="frequency [rad/s]", ylim=(0, HIGHEST))
    left.set_title("one handedness: bands")
    for name, colour, at in (("extension", "C0", (1.3, 140)), ("twist", "C1", (2.6, 32))):
        middle.plot(tables["wave"]["x"], 1e3 * tables["wave"][name], colour)
        middle.plot(tables["after"]["x"], 1e3 * tables["after"][name], "o", color=colour, ms=4)
        middle.annotate(name, at, color=colour)
    middle.set_xlabel("distance from the peak [units]")
    middle.set_ylabel("difference from plate to plate [mm]")
    middle.set_title(f"one handedness: the same after {TRAVEL} units (dots)")
    for name, color, level in zip(GYRATIONS, ("C2", "C3"), (0.72, 0.31), strict=True):
        units, share, loose = tables[name].values()
        right.plot(units, share, color, units, loose, f"{color}.", ms=4)
        right.annotate(f"gyration {name}", (55, level), color=color)
    right.set(xlabel="units travelled", ylabel="fraction of energy near the peak", ylim=(0, 1.05))
    right.set_title("alternating: the wave of the chain decays")


def table(tables):
    for units, *each in zip(*tables["models"].values(), strict=True):
        yield {"wave": f"{units:g} units long"} | dict(zip(BRANCHES, map(float, each), strict=True))
    for tolerance, off, behind, residual, speed in zip(*tables["travel"].values(), strict=True):
        yield {"wave": f"{KINDS[1]}, {TRAVEL} units at tol {tolerance:g}",
               "off": float(off), "left behind": float(behind), "residual": float(residual),
               "speed [units/s]": float(speed)}  # fmt: skip
    for name in GYRATIONS:
        share = float(tables[name]["share"][-1])
        yield {"wave": f"alternating, gyration {name}, {SHED} units", "share left": share}
