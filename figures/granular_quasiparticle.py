"""A quasi-particle predicts what a junction transmits, and overestimates what it reflects.

Eq. (7) of the paper against the half-angle. It distributes momentum and energy over the waves
alone. In the runs the beads between them retain a slow backward motion, with next to no energy but
with the momentum that the reflected wave lacks. Where eq. (7) predicts a wave of negative momentum,
there is none. Below 30 degrees the first beads of the branches, which touch each other, withhold
energy from both waves, the more the smaller the angle.
"""

import math

import numpy as np

from derivations import contact, junction
from figures import _guide
from figures._guide import STEEL
from granular import sensor_force, simulate, y_guide
from tensegrity import Record, first_peak, peaks

NAME = "granular_quasiparticle"
GROUP = "granular"

DEGREES = (10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60)
PAPER = 30  # deg, of the paper; below, the first beads of the branches keep each other off the axes
END, DT = 420e-6, 0.4e-6  # s
WHOLE = (-30e-6, 165e-6)  # s after the incident peak: waves are away from junction and ends
REACH = 3  # beads of a wave on each side of its peak
SPEED = 0.585  # m/s
WITHIN = (30e-6, 130e-6)  # s after the incident peak at bead 16, in which a reflected one passes
FAINTEST = 2e-4  # of the incident force: threshold of a pulse
STEM, BRANCH = 19, 23


def data(by=1.0):
    """Momenta of the reflected and the transmitted wave and of slow beads, over the incident one's.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    power = 1 / float(contact.scalings()[0].subs(contact.exponent, 1.5))
    angles = [math.radians(d) for d in DEGREES]
    found = [_split(y_guide(STEM, BRANCH, angle, bead=STEEL, striker=_guide.light(by * SPEED)))
             for angle in angles]  # fmt: skip
    back, forth, slow = np.array(found).T
    columns = {"half angle [deg]": np.array(DEGREES, dtype=float), "I1/I0": back**power,
               "I2/I0": forth**power, "slow beads": slow}  # fmt: skip
    for label, ratio in zip(("I1/I0, eq. (7)", "I2/I0, eq. (7)"), junction.split(), strict=True):
        known = (ratio / junction.incident).subs(junction.waves, 1)
        columns[label] = np.array([float(known.subs(junction.half_angle, x)) for x in angles])
    return {"momenta": columns, "limit": {"deg": [math.degrees(junction.no_reflection())]}}


def _split(guide):
    """Peak forces of the reflected (nan: none) and the transmitted wave over the incident one's.

    And the momentum left to slow beads between them, over the incident wave's.
    """
    run = simulate(guide, guide.start(), END, dt=DT, method="rkn6", record=Record())
    force = {n: sensor_force(run, "stem 1", n) for n in (12, 16)}
    instant, incident = first_peak(run.t, force[16])
    transmitted = first_peak(run.t, sensor_force(run, "branch 1", 8))[1]
    found = []
    for n in (16, 12):
        inside = (run.t > instant + WITHIN[0]) & (run.t < instant + WITHIN[1])
        times, heights = peaks(run.t[inside], force[n][inside], 0.5)
        keep = heights > FAINTEST * incident
        found.append((times[keep], heights[keep]))
    (t_near, f_near), (t_far, _) = found
    reflected = np.nan
    if t_near.size and t_far.size and t_far[0] > t_near[0]:  # it runs backwards
        reflected = f_near[0]
    slow = np.nan if np.isnan(reflected) else _slow(run, instant)
    return reflected / incident, transmitted / incident, slow


def _slow(run, instant):
    """Momentum along x of the beads between the reflected and the transmitted waves, over I0.

    They were at rest before the split: the incident wave leaves no motion behind so far from the
    striker.
    """
    forces = sensor_force(run, range(run.scene.sites))
    before, after = (int(np.searchsorted(run.t, instant + way)) for way in WHOLE)

    def momentum(at, sites):
        return float(run.scene.mass[sites] @ run.v[at, sites, 0])

    def parted(at, part, offset):
        """Momenta of the beads of a part before and beyond its peak by more than an offset."""
        sites = np.array(run.scene.parts[part])
        place = np.argmax(forces[at, sites]) + offset
        return momentum(at, sites[:place]), momentum(at, sites[place:])

    slow = parted(after, "stem 1", REACH + 1)[1]
    slow += sum(parted(after, part, -REACH)[0] for part in ("branch 1", "branch 2"))
    return slow / parted(before, "stem 1", -REACH)[1]


def table(tables):
    """Momenta by simulation and by eq. (7)."""
    m, lines = tables["momenta"], {}
    for k, degrees in enumerate(DEGREES):
        for wave in ("I1/I0", "I2/I0"):
            here = float(m[wave][k])
            theory = f"{m[f'{wave}, eq. (7)'][k]:.4f}"
            lines[f"{wave} at {degrees} deg"] = "none" if math.isnan(here) else here, theory
    at = DEGREES.index(PAPER)
    back, forth, slow = (m[name][at] for name in ("I1/I0", "I2/I0", "slow beads"))
    missing = 1 + back - 2 * forth * math.cos(math.radians(PAPER))
    lost = 1 - m["I1/I0"] ** 2 - 2 * m["I2/I0"] ** 2
    lines |= {
        "momentum in neither wave, over I0, at 30 deg": (missing, "0"),
        "momentum of the slow beads between them, at 30 deg": (slow, "0"),
        "energy in neither wave at 20 deg": (lost[DEGREES.index(20)], "0"),
        "energy in neither wave at 30 deg": (lost[at], "0"),
    }
    return _guide.rows("eq. (7)", lines)


def draw(figure, tables):
    """Momenta against half-angle."""
    figure.set_size_inches(8, 4.5)
    axes, m = figure.subplots(), tables["momenta"]
    angles = m["half angle [deg]"]
    for k, wave in enumerate(("I1/I0", "I2/I0")):
        axes.plot(angles, m[f"{wave}, eq. (7)"], f"C{k}-", lw=1)
        axes.plot(angles, m[wave], f"C{k}o")
    axes.text(32, 0.62, "transmitted", color="C1")
    axes.text(32, 0.21, "reflected", color="C0")
    axes.text(11, -0.1, "lines: eq. (7); dots: runs")
    limit = tables["limit"]["deg"][0]
    axes.axvline(limit, color="k", lw=0.6, ls=":")
    axes.text(limit + 0.5, 0.02, "no reflected pulse in the runs", fontsize=9)
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlabel="half angle [°]", ylabel="momentum over that of the incident wave")
