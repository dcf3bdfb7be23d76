"""Eq. (7) of seeds/001 for any half-angle: a wave at the junction as a quasi-particle, or not."""

from __future__ import annotations

import math

import numpy as np

from derivations import contact, junction
from figures import _guide
from figures._guide import STEEL, row
from granular import materials, sensor_force, simulate, y_guide
from granular.guide import Guide
from granular.layout import crossed_layout
from granular.observables import peak, pulses
from tensegrity import Record

NAME = "granular_quasiparticle"
GROUP = "granular"

DEGREES = (10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60)
TOUCHING = 30  # from here on the first beads of the branches stand on their axes
END, DT = 420e-6, 0.2e-6  # s
SPEED = 0.585  # m/s
WITHIN = (30e-6, 130e-6)  # s after the incident peak at bead 16, in which a reflected one passes
FAINTEST = 2e-4  # of the incident force: what is weaker is no pulse
STEM, BRANCH = 19, 23


def data():
    """Momenta of the reflected and the transmitted wave over the incident one's."""
    power = 1 / float(contact.scalings()[0].subs(contact.exponent, 1.5))
    columns = {"half angle [deg]": np.array(DEGREES, dtype=float)}
    scenes = {"beads touch": _touching, "branches cross": _crossed}
    for name, build in scenes.items():
        found = np.array([_split(build(math.radians(d))) for d in DEGREES])
        columns[f"I1/I0, {name}"], columns[f"I2/I0, {name}"] = (found**power).T
    theory = [x / junction.incident for x in junction.split()]
    for label, ratio in zip(("I1/I0, eq. (7)", "I2/I0, eq. (7)"), theory, strict=True):
        known = ratio.subs(junction.waves, 1)
        columns[label] = np.array(
            [float(known.subs(junction.half_angle, math.radians(d))) for d in DEGREES]
        )
    return {"momenta": columns, "limit": {"deg": [math.degrees(junction.no_reflection())]}}


def _touching(half_angle):
    return y_guide(STEM, BRANCH, half_angle, bead=STEEL, striker=_guide.light(SPEED))


def _crossed(half_angle):
    layout = crossed_layout(STEM, BRANCH, half_angle, STEEL.diameter)
    beads = dict.fromkeys(layout.parts, STEEL)
    return Guide(layout, beads, materials["ptfe"], _guide.light(SPEED))


def _split(guide):
    """Peak forces of the reflected (nan: none) and the transmitted wave over the incident one's."""
    record = Record(every=2)
    run = simulate(guide, guide.start(), END, dt=DT, method="rkn6", record=record)
    force = {n: sensor_force(run, guide, "stem 1", n) for n in (12, 16)}
    instant, incident = peak(run.t, force[16])
    transmitted = peak(run.t, sensor_force(run, guide, "branch 1", 8))[1]
    found = []
    for n in (16, 12):
        inside = (run.t > instant + WITHIN[0]) & (run.t < instant + WITHIN[1])
        times, heights = pulses(run.t[inside], force[n][inside], 0.5)
        keep = heights > FAINTEST * incident
        found.append((times[keep], heights[keep]))
    (t_near, f_near), (t_far, _) = found
    reflected = np.nan
    if t_near.size and t_far.size and t_far[0] > t_near[0]:  # it runs backwards
        reflected = f_near[0]
    return reflected / incident, transmitted / incident


def table(tables):
    """Momenta by simulation beside eq. (7)."""
    m, lines = tables["momenta"], []
    for k, degrees in enumerate(DEGREES):
        for wave in ("I1/I0", "I2/I0"):
            kinds = ("beads touch", "branches cross") if degrees < TOUCHING else ("beads touch",)
            for kind in kinds:
                here = float(m[f"{wave}, {kind}"][k])
                note = f" ({kind})" if len(kinds) > 1 else ""
                lines.append(
                    row("eq. (7)", f"{wave} at {degrees} deg{note}",
                        "none" if np.isnan(here) else f"{here:.4f}",
                        f"{m[f'{wave}, eq. (7)'][k]:.4f}")
                )  # fmt: skip
    return lines


def draw(figure, tables):
    """Momenta against half-angle."""
    figure.set_size_inches(8, 4.5)
    axes = figure.subplots()
    m = tables["momenta"]
    for k, wave in enumerate(("I1/I0", "I2/I0")):
        axes.plot(m["half angle [deg]"], m[f"{wave}, eq. (7)"], f"C{k}-", lw=1,
                  label=f"{wave}, eq. (7)")  # fmt: skip
        for kind, mark in (("beads touch", "o"), ("branches cross", "x")):
            shown = m["half angle [deg]"] < TOUCHING + (0 if mark == "x" else 90)
            axes.plot(m["half angle [deg]"][shown], m[f"{wave}, {kind}"][shown], f"C{k}{mark}",
                      label=f"{wave}, {kind}")  # fmt: skip
    axes.axvline(tables["limit"]["deg"][0], color="k", lw=0.6, ls=":")
    axes.axhline(0, color="k", lw=0.6)
    axes.set(xlabel="half angle [deg]", ylabel="momentum over that of the incident wave")
    axes.legend(fontsize=7, ncols=2)
