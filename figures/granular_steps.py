"""A step to lighter beads turns a pulse into a train; one to heavier beads reflects part of it."""

from __future__ import annotations

import numpy as np

from figures import _beads
from figures._beads import bead
from figures._guide import row
from granular import Bead, chain, materials, simulate
from tensegrity import Record, peaks

NAME = "granular_steps"
GROUP = "granular"

BEFORE, AFTER = 30, 60  # beads on both sides of the step
LEVEL = 0.05  # of the largest peak: threshold of a counted pulse
STEEL = bead("steel")
SOFT = Bead(STEEL.diameter, materials["nylon"], STEEL.mass)  # as heavy as steel
SCENES = {  # first beads, second beads, duration [s], what the talk says
    "large to small radius": (bead("steel", 2), STEEL, 1.3e-3, "train"),
    "small to large radius": (STEEL, bead("steel", 2), 1.5e-3, "partial reflection"),
    "hard to soft (steel to PTFE)": (STEEL, bead("ptfe"), 2.2e-3, "train"),
    "soft to hard (PTFE to steel)": (bead("ptfe"), STEEL, 2.6e-3, "partial reflection"),
    "hard to soft, equal masses": (STEEL, SOFT, 2.4e-3, "train"),
    "soft to hard, equal masses": (SOFT, STEEL, 2.4e-3, "partial reflection"),
}
SENSOR = 15  # beads behind the step
BACK = 5  # beads before it
PRELOADS, BLOW, LONG = (0.0, 20.0), 0.05, 3e-3  # N, m/s, s: of a step that is a diode


def data(by=1.0):
    """Energy density of each scene, the force behind its step, the transmitted energy.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {}
    for name, (first, second, t_end, _) in SCENES.items():
        run = _beads.struck([first] * BEFORE + [second] * AFTER, t_end, by * _beads.SPEED)
        forces = run.scene.contact_forces(run.u)
        beyond = run.scene.site_energy(run)[:, BEFORE + 1 :].sum(1) / run.energy[0]
        tables[f"{name} density"] = _beads.energies(run)
        tables[f"{name} sensors"] = {
            "t [s]": run.t,
            "behind the step [N]": forces[:, BEFORE + SENSOR],
            "before the step [N]": forces[:, BEFORE - BACK],
            "energy beyond": beyond,
        }
        tables[f"{name} numbers"] = {"energy error": [run.energy_error]}
    pair = STEEL, bead("ptfe")
    tables["diode"] = {
        "preload [N]": PRELOADS,
        "steel to PTFE": [passed(*pair, preload, by * BLOW) for preload in PRELOADS],
        "PTFE to steel": [passed(*pair[::-1], preload, by * BLOW) for preload in PRELOADS],
    }
    return tables


def passed(first, second, preload, blow):
    """Fraction of the kinetic energy beyond the step after a blow on the first bead, in the mean
    while the front is well behind the step."""
    scene = chain([first] * BEFORE + [second] * AFTER, preload=preload)
    record = Record(interval=LONG / 600)
    run = simulate(scene, scene.at_rest({0: blow}), LONG, tol=1e-6, record=record)
    energy = scene.mass * run.v**2
    front = np.array([np.flatnonzero(x > 1e-4 * x.max())[-1] for x in energy])
    away = (front > BEFORE + SENSOR) & (front < BEFORE + AFTER - 8)
    return float((energy[away, BEFORE:].sum(axis=1) / energy[away].sum(axis=1)).mean())


def table(tables):
    """Pulses that leave the step, and the energy that passes it."""
    lines = []
    for name, (_, _, _, said) in SCENES.items():
        read = tables[f"{name} sensors"]
        count = len(peaks(read["t [s]"], read["behind the step [N]"], LEVEL)[1])
        passed = float(read["energy beyond"][np.argmax(read["behind the step [N]"])])
        lines += [
            row("steps", f"{name}: pulses above 5 % behind the step", count, said),
            row("steps", f"{name}: energy beyond it as the largest passes", passed),
        ]
    preloads, *ways = tables["diode"].items()
    for k, preload in enumerate(preloads[1]):
        for way, found in ways:
            words = f"{way}, preload {preload:g} N: energy that passes the step"
            lines.append(row("steps", words, float(found[k])))
    return lines


def draw(figure, tables):
    """Energy densities, two scenes per row."""
    figure.set_size_inches(9, 9.5)
    axes = figure.subplots(3, 2)
    for one, name in zip(axes.ravel(), SCENES, strict=True):
        image = _beads.draw_density(one, tables[f"{name} density"], name, [BEFORE])
    figure.colorbar(image, ax=axes, label="energy over that of the striker", shrink=0.6)
