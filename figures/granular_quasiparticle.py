"""A quasi-particle predicts what a junction transmits, and overestimates what it reflects.

Eq. (7) of the paper against the half-angle. It distributes momentum and energy over the waves
alone. In the runs the beads between them retain a slow backward motion, with next to no energy but
with the momentum that the reflected wave lacks. Where eq. (7) predicts a wave of negative momentum,
there is none. Below 30 degrees the first beads of the branches, which touch each other, withhold
energy from both waves, the more the smaller the angle.
"""

from __future__ import annotations

import math

import numpy as np

from derivations import contact, junction
from figures import _guide
from figures._guide import STEEL, row
from granular import Guide, materials, sensor_force, simulate, y_guide
from granular.layout import crossed_layout
from tensegrity import Record, first_peak, peaks

NAME = "granular_quasiparticle"
GROUP = "granular"

DEGREES = (10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60)
BELOW = 20  # deg: where the two geometries are compared
TOUCHING = 30  # from here on the first beads of the branches stand on their axes
END, DT = 420e-6, 0.4e-6  # s
WHOLE = (-30e-6, 165e-6)  # s after the incident peak: waves are away from junction and ends
REACH = 3  # beads of a wave on each side of its peak
SPEED = 0.585  # m/s
WITHIN = (30e-6, 130e-6)  # s after the incident peak at bead 16, in which a reflected one passes
FAINTEST = 2e-4  # of the incident force: threshold of a pulse
STEM, BRANCH = 19, 23


def data(by=1.0):
    """Momenta of the reflected and the transmitted wave over the incident one's.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    power = 1 / float(contact.scalings()[0].subs(contact.exponent, 1.5))
    columns = {"half angle [deg]": np.array(DEGREES, dtype=float)}
    scenes = {"beads touch": (_touching, 90), "branches cross": (_crossed, TOUCHING)}
    nothing = np.full(3, np.nan)
    for name, (build, below) in scenes.items():
        found = [
            _split(build(math.radians(d), by * SPEED)) if d < below else nothing for d in DEGREES
        ]
        back, forth, slow = np.array(found).T
        columns[f"I1/I0, {name}"], columns[f"I2/I0, {name}"] = back**power, forth**power
        columns[f"slow beads, {name}"] = slow
    theory = [x / junction.incident for x in junction.split()]
    for label, ratio in zip(("I1/I0, eq. (7)", "I2/I0, eq. (7)"), theory, strict=True):
        known = ratio.subs(junction.waves, 1)
        columns[label] = np.array(
            [float(known.subs(junction.half_angle, math.radians(d))) for d in DEGREES]
        )
    return {"momenta": columns, "limit": {"deg": [math.degrees(junction.no_reflection())]}}


def _touching(half_angle, speed):
    return y_guide(STEM, BRANCH, half_angle, bead=STEEL, striker=_guide.light(speed))


def _crossed(half_angle, speed):
    layout = crossed_layout(STEM, BRANCH, half_angle, STEEL.diameter)
    beads = dict.fromkeys(layout.parts, STEEL)
    return Guide(layout, beads, materials["ptfe"], _guide.light(speed))


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

    def beyond(at, part, offset):
        """Momentum of the beads of a part beyond its peak by more than an offset."""
        sites = np.array(run.scene.parts[part])
        chosen = sites[np.argmax(forces[at, sites]) + offset :]
        return float(run.scene.mass[chosen] @ run.v[at, chosen, 0])

    def within(at, part):
        sites = list(run.scene.parts[part])
        return float(run.scene.mass[sites] @ run.v[at, sites, 0])

    slow = beyond(after, "stem 1", REACH + 1)
    for part in ("branch 1", "branch 2"):
        slow += within(after, part) - beyond(after, part, -REACH)
    return slow / beyond(before, "stem 1", -REACH)


def table(tables):
    """Momenta by simulation and by eq. (7)."""
    m, lines = tables["momenta"], []
    for k, degrees in enumerate(DEGREES):
        for wave in ("I1/I0", "I2/I0"):
            kinds = ("beads touch", "branches cross") if degrees < TOUCHING else ("beads touch",)
            for kind in kinds:
                here = float(m[f"{wave}, {kind}"][k])
                note = f" ({kind})" if len(kinds) > 1 else ""
                lines.append(
                    row("eq. (7)", f"{wave} at {degrees} deg{note}",
                        "none" if np.isnan(here) else here,
                        f"{m[f'{wave}, eq. (7)'][k]:.4f}")
                )  # fmt: skip
    at = DEGREES.index(TOUCHING)
    back, forth = (float(m[f"{wave}, beads touch"][at]) for wave in ("I1/I0", "I2/I0"))
    slow = float(m["slow beads, beads touch"][at])
    missing = 1 + back - 2 * forth * math.cos(math.radians(TOUCHING))
    lines += [
        row("eq. (7)", "momentum in neither wave, over I0, at 30 deg", missing, "0"),
        row("eq. (7)", "momentum of the slow beads between them, at 30 deg", slow, "0"),
    ]
    at = DEGREES.index(BELOW)
    for kind in ("beads touch", "branches cross"):
        back, forth = (float(m[f"{wave}, {kind}"][at]) for wave in ("I1/I0", "I2/I0"))
        lost = 1 - back**2 - 2 * forth**2
        lines.append(row("eq. (7)", f"energy in neither wave at {BELOW} deg ({kind})", lost, "0"))
    return lines


def draw(figure, tables):
    """Momenta against half-angle."""
    figure.set_size_inches(8, 4.5)
    axes, m = figure.subplots(), tables["momenta"]
    angles = m["half angle [deg]"]
    for k, wave in enumerate(("I1/I0", "I2/I0")):
        axes.plot(angles, m[f"{wave}, eq. (7)"], f"C{k}-", lw=1)
        for kind, mark in (("beads touch", "o"), ("branches cross", "x")):
            shown = angles < TOUCHING + (0 if mark == "x" else 90)
            axes.plot(angles[shown], m[f"{wave}, {kind}"][shown], f"C{k}{mark}")
    axes.text(32, 0.62, "transmitted", color="C1")
    axes.text(32, 0.21, "reflected", color="C0")
    axes.text(
        11, -0.2, "lines: eq. (7)\n●  runs, beads of both branches touch\nx  runs, branches cross"
    )
    limit = tables["limit"]["deg"][0]
    axes.axvline(limit, color="k", lw=0.6, ls=":")
    axes.text(limit + 0.5, 0.02, "no reflected pulse in the runs", fontsize=9)
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlabel="half angle [°]", ylabel="momentum over that of the incident wave")
