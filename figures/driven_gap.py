"""Transmission of driven diatomic chains falls inside the computed band gap.

The first site is driven at one frequency after another; dashpots graded towards the far end absorb
the arriving waves.  The ratio of amplitudes of successive cells, far from both ends, is compared
with the closed form: 1 in a band, exp(-kappa) in the gap, with cosh kappa = |cos q| of the
dispersion relation.  Close to an edge of the gap transients decay slowly: with a drive that comes
up in 15 of 60 periods the ratio there is 0.11 off the closed form, with 60 of 240 less than 0.01.
"""

from __future__ import annotations

import math

import numpy as np

from granular import Bead, chain, materials
from tensegrity import Chain, Damping, Drive, Potential, Record, dispersion, modes, simulate

NAME = "driven_gap"
GROUP = "driven"

CELLS, NEAR, FAR, SOFT = 45, 1, 6, 15  # cells; between which is measured; where dashpots begin
PERIODS, RISE, SEEN = 240, 60, 4  # of a run, in which the drive comes up, at the end that are used
LONGER = 2.0  # preload, relative, at which the edges are computed again
STRENGTH = 0.35  # of the last dashpot, over the root of stiffness times mass
COUNT = 24  # frequencies
HEAVY = 2.5  # kg; the other mass is 1 kg, springs are 1 N/m
PRELOAD = 20.0  # N, on alternating beads of steel and PTFE
TITLES = {"masses": "masses 1 and 2.5", "beads": "steel and PTFE beads, precompressed"}
SCENES = tuple(TITLES)
SIZES = dict(zip(SCENES, (1e-3, 1e-9), strict=True))  # of the drive [m]: waves stay linear


def scene(name, drive=None):
    """A chain of alternating masses, its dashpots included; drive: {site: Drive}."""
    sites = 2 * CELLS
    fraction = np.clip((np.arange(sites) / 2 - SOFT) / (CELLS - SOFT), 0, None) ** 2
    if name == SCENES[0]:
        import sympy as sp

        r = sp.Symbol("r")
        spring, mass = Potential(r**2 / 2, r, length=1.0), np.tile([1.0, HEAVY], CELLS)
        return Chain(spring, sites, mass, drive=drive, damping=Damping(ground=STRENGTH * fraction))
    pair = [Bead(4.76e-3, materials[x]) for x in ("ptfe", "steel")]
    row = chain(pair * CELLS, preload=PRELOAD)
    k = float(row.springs[4].stiffness(0.0))
    damping = Damping(ground=STRENGTH * math.sqrt(k * row.mass[1]) * fraction)
    return chain(pair * CELLS, preload=PRELOAD, drive=drive, damping=damping)


def numbers(name):
    """Stiffness, masses of a cell, and the four edges of its bands [rad/s]."""
    given = scene(name)
    spring, masses = given.springs[4], given.mass[:2]
    edges = [dispersion(spring, masses, [q])[0] for q in (0.0, math.pi)]
    return spring, masses, (0.0, *edges[1], edges[0][1])


def ratio(name, frequency, periods=PERIODS, rise=RISE):
    """Amplitude of a cell over that of the cell before, in a run driven at a frequency, and the
    error of its energy: for precompressed beads the round-off of the energy stored at rest."""
    import sympy as sp

    t, period = sp.Symbol("t"), 2 * math.pi / frequency
    grown = 1 - sp.exp(-((t / (rise * period)) ** 4))
    shaken = scene(name, {0: Drive(displacement=SIZES[name] * grown * sp.sin(frequency * t))})
    end = periods * period
    record = Record(times=np.linspace(end - SEEN * period, end, 40 * SEEN + 1)[1:].tolist(),
                    sites=(2 * NEAR, 2 * FAR))  # fmt: skip
    run = simulate(shaken, shaken.at_rest(), end, method="rkn6", record=record)
    phase = frequency * run.t
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
    found = np.linalg.lstsq(waves, run.u, rcond=None)[0]
    near, far = np.hypot(*found)
    return float((far / near) ** (1 / (FAR - NEAR))), run.energy_error


def decay(spring, masses, frequency):
    """exp(-kappa) of a cell from the closed form; 1 in a band."""
    k, (one, other) = float(spring.stiffness(0.0)), masses
    square = np.asarray(frequency) ** 2
    cosine = 1 - (one + other) * square / k + one * other * square**2 / (2 * k**2)
    return np.exp(-np.arccosh(np.maximum(np.abs(cosine), 1.0)))


def swept(name):
    """Driven ratios over frequency, and those of the closed form."""
    spring, masses, (_, low, _, top) = numbers(name)
    fractions = np.linspace(0.12, 0.98, COUNT)
    w = (
        fractions[np.abs(fractions * top - low) > 0.01 * top] * top
    )  # the group velocity vanishes at an edge
    found = [ratio(name, float(x)) for x in w]
    return {
        "frequency": w,
        "ratio": np.array([x for x, _ in found]),
        "closed form": decay(spring, masses, w),
        "balance": np.array([x for _, x in found]),
    }


def data():
    """Bands, frequencies of the finite chain, and driven ratios of both chains."""
    tables = {}
    q = np.linspace(0, math.pi, 181)
    for name in SCENES:
        spring, masses, edges = numbers(name)
        bands = dispersion(spring, masses, q)
        tables[f"{name} bands"] = {"wavenumber": q, "acoustic": bands[:, 0], "optic": bands[:, 1]}
        tables[f"{name} edges"] = {"edge": np.array(edges)}
        found = modes(scene(name), count=2 * CELLS).frequencies
        tables[f"{name} modes"] = {"frequency": found}
        tables[f"{name} driven"] = swept(name)
    tables["tuned"] = {"power of the preload": np.array([0.0, tuning()])}
    return tables


def tuning():
    """Power of the preload with which all edges of the gap of the beads grow."""
    edges = []
    for preload in (PRELOAD, LONGER * PRELOAD):
        row = chain([Bead(4.76e-3, materials[x]) for x in ("ptfe", "steel")] * 3, preload=preload)
        edges.append(dispersion(row.springs[2], row.mass[:2], [math.pi])[0])
    powers = np.log(edges[1] / edges[0]) / math.log(LONGER)
    return float(powers.mean())


def draw(figure, tables):
    """Bands on the left, driven amplitude ratios at the same frequencies on the right."""
    figure.set_size_inches(9, 7.4)
    axes = figure.subplots(2, 2)
    for row, name in zip(axes, SCENES, strict=True):
        unit = 1.0 if name == SCENES[0] else 1e3
        label = "frequency [rad/s]" if unit == 1 else "frequency [krad/s]"
        _, low, high, top = tables[f"{name} edges"]["edge"] / unit
        bands, driven = tables[f"{name} bands"], tables[f"{name} driven"]
        left, right = row
        for key, color, at in (("acoustic", "C0", 0.4 * low), ("optic", "C3", 0.965 * top)):
            left.plot(bands["wavenumber"], bands[key] / unit, color)
            left.annotate(f"{key} band", (1.9, at), color=color)
        left.annotate("gap", (0.15, (low + high) / 2), va="center", color="0.4")
        still = tables[f"{name} modes"]["frequency"] / unit
        left.plot(np.full(len(still), math.pi * 1.04), still, "k_", ms=7)
        left.annotate("modes of the finite chain", (3.1, 0.03 * top), ha="right")
        left.set(xlabel="wavenumber [rad per cell]", ylabel=label)
        fine = np.linspace(driven["frequency"][0], driven["frequency"][-1], 400)
        spring, masses, _ = numbers(name)
        right.plot(decay(spring, masses, fine), fine / unit, "k-", lw=1, label="closed form")
        right.plot(driven["ratio"], driven["frequency"] / unit, "o", color="C2", ms=5,
                   label="driven runs")  # fmt: skip
        right.set(xlabel="amplitude ratio of successive cells", xlim=(0, 1.12), ylabel=label)
        right.legend(loc="lower left")
        for ax in row:
            ax.axhspan(low, high, color="0.88")
            ax.axhline(top, color="0.6", lw=0.8, ls="--")
            ax.set_ylim(0, 1.15 * top)
    titles = (
        "(a) Masses 1 and 2.5 leave a gap",
        "(b) in which no driven wave gets far",
        "(c) So do beads of steel and PTFE, pressed",
        "(d) and their waves stay out, too",
    )
    for ax, title in zip(axes.flat, titles, strict=True):
        ax.set_title(title, fontsize=10)


def table(tables):
    """Edges and the largest difference in and out of the gap."""
    rows, power = [], tables["tuned"]["power of the preload"]
    for k, name in enumerate(SCENES):
        _, low, high, top = tables[f"{name} edges"]["edge"].tolist()
        driven = tables[f"{name} driven"]
        inside = (driven["frequency"] > low) & (driven["frequency"] < high)
        gap = np.abs(driven["ratio"] - driven["closed form"])
        rows.append({
            "chain": TITLES[name], "gap from [rad/s]": low, "to": high, "cut-off": top,
            "largest ratio in the gap": float(driven["ratio"][inside].max()),
            "least in bands": float(driven["ratio"][~inside].min()),
            "off the closed form": float(gap[inside].max()),
            "balance of energy": float(driven["balance"].max()),
            "power of the preload in the edges": float(power[k]),
        })  # fmt: skip
    return rows
