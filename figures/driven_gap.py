"""Transmission of driven diatomic chains falls inside the computed band gap.

The first site is driven at one frequency after another; dashpots graded towards the far end absorb
the arriving waves.  The ratio of amplitudes of successive cells, far from both ends, is compared
with the closed form: 1 in a band, exp(-kappa) in the gap, with cosh kappa = |cos q| of the
dispersion relation.  Close to an edge of the gap transients decay slowly: with a drive that comes
up in 15 of 60 periods the ratio there is 0.11 off the closed form, with 60 of 240 less than 0.01.
"""

import math

import numpy as np

from granular import Bead, chain, materials
from tensegrity import Chain, Damping, Drive, Potential, Record, dispersion, simulate

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
SAID = {
    "masses": ("Masses 1 and 2.5 leave a gap", "in which no driven wave gets far"),
    "beads": ("So do beads of steel and PTFE, pressed", "and their waves stay out, too"),
}
SCENES = tuple(TITLES)
SIZES = dict(zip(SCENES, (1e-3, 1e-9), strict=True))  # of the drive [m]: waves stay linear


def beads(preload, cells=CELLS, **options):
    """Alternating precompressed beads."""
    return chain(
        [Bead(4.76e-3, materials[x]) for x in ("ptfe", "steel")] * cells, preload=preload, **options
    )


def scene(name, drive=None):
    """A chain of alternating masses, its dashpots included; drive: {site: Drive}."""
    fraction = np.clip((np.arange(2 * CELLS) / 2 - SOFT) / (CELLS - SOFT), 0, None) ** 2
    if name == SCENES[0]:
        import sympy as sp

        r = sp.Symbol("r")
        spring = Potential(r**2 / 2, r, length=1.0)
        return Chain(spring, 2 * CELLS, np.tile([1.0, HEAVY], CELLS), drive=drive,
                     damping=Damping(ground=STRENGTH * fraction))  # fmt: skip
    row = beads(PRELOAD)
    strength = STRENGTH * math.sqrt(float(row.springs[4].stiffness(0.0)) * row.mass[1])
    return beads(PRELOAD, drive=drive, damping=Damping(ground=strength * fraction))


def numbers(name):
    """Spring, masses of a cell, and the four edges of its bands [rad/s]."""
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
    waves = np.exp(1j * frequency * run.t)[:, None]
    near, far = np.abs(np.mean(run.u * waves, axis=0))  # whole periods, in equal steps
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
    w = np.linspace(0.12, 0.98, COUNT) * top
    w = w[np.abs(w - low) > 0.01 * top]  # the group velocity vanishes at an edge
    found, balance = np.transpose([ratio(name, float(x)) for x in w])
    exact = decay(spring, masses, w)
    return {"frequency": w, "ratio": found, "closed form": exact, "balance": balance}


def data():
    """Bands and driven ratios of both chains."""
    tables, q = {"tuned": {"power of the preload": [0.0, tuning()]}}, np.linspace(0, math.pi, 181)
    for name in SCENES:
        spring, masses, edges = numbers(name)
        acoustic, optic = dispersion(spring, masses, q).T
        tables[f"{name} bands"] = {"wavenumber": q, "acoustic": acoustic, "optic": optic}
        tables[f"{name} edges"] = {"edge": np.array(edges)}
        tables[f"{name} driven"] = swept(name)
    return tables


def tuning():
    """Power of the preload with which all edges of the gap of the beads grow."""
    rows = [beads(preload, 3) for preload in (PRELOAD, LONGER * PRELOAD)]
    first, last = (dispersion(row.springs[2], row.mass[:2], [math.pi])[0] for row in rows)
    return float(np.log(last / first).mean() / math.log(LONGER))


def draw(figure, tables):
    """Bands on the left, driven amplitude ratios at the same frequencies on the right."""
    figure.set_size_inches(9, 7.4)
    for row, (name, words) in zip(figure.subplots(2, 2), SAID.items(), strict=True):
        unit, label = (1.0, "rad/s") if name == SCENES[0] else (1e3, "krad/s")
        _, low, high, top = tables[f"{name} edges"]["edge"] / unit
        left, right = row
        bands = tables[f"{name} bands"]
        for key, color, at in (("acoustic", "C0", 0.4 * low), ("optic", "C3", 0.965 * top)):
            left.plot(bands["wavenumber"], bands[key] / unit, color)
            left.annotate(f"{key} band", (1.9, at), color=color)
        left.annotate("gap", (0.15, (low + high) / 2), va="center", color="0.4")
        left.set(xlabel="wavenumber [rad per cell]")
        w, ratios, *_ = tables[f"{name} driven"].values()
        fine = np.linspace(w[0], w[-1], 400)
        right.plot(decay(*numbers(name)[:2], fine), fine / unit, "k-", lw=1, label="closed form")
        right.plot(ratios, w / unit, "C2o", ms=5, label="driven runs")
        right.set(xlabel="amplitude ratio of successive cells", xlim=(0, 1.12))
        right.legend(loc="lower left")
        for ax, title in zip(row, words, strict=True):
            ax.axhspan(low, high, color="0.88")
            ax.axhline(top, color="0.6", lw=0.8, ls="--")
            ax.set(ylim=(0, 1.15 * top), ylabel=f"frequency [{label}]", title=title)


def table(tables):
    """Edges, and the largest differences from the closed form in the bands and in the gap."""
    rows, power = [], tables["tuned"]["power of the preload"]
    for k, name in enumerate(SCENES):
        _, low, high, top = tables[f"{name} edges"]["edge"].tolist()
        w, ratios, exact, balance = tables[f"{name} driven"].values()
        inside = (w > low) & (w < high)
        rows.append({
            "chain": TITLES[name], "gap from [rad/s]": low, "to": high, "cut-off": top,
            "off 1 in bands": np.abs(ratios - 1)[~inside].max(),
            "off the closed form": np.abs(ratios - exact)[inside].max(),
            "balance of energy": balance.max(), "power of the preload in the edges": power[k],
        })  # fmt: skip
    return rows
