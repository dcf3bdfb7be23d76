"""A step to lighter beads turns a pulse into a train; one to heavier beads reflects part of it."""

import numpy as np

from figures import _guide
from granular import Bead, Striker, chain, hertz, materials, simulate
from tensegrity import Record, State, peaks

NAME = "granular_steps"
GROUP = "granular"

BEFORE, AFTER = 30, 60  # beads on both sides of the step
LEVEL = 0.05  # of the largest peak: threshold of a counted pulse
STEEL, GREAT = (Bead(ratio * 4.76e-3, materials["steel"]) for ratio in (1, 2))
PTFE = Bead(STEEL.diameter, materials["ptfe"])
SOFT = Bead(STEEL.diameter, materials["nylon"], STEEL.mass)  # as heavy as steel
SCENES = {  # first beads, second beads, duration [s], what the talk says
    "large to small radius": (GREAT, STEEL, 1.3e-3, "train"),
    "small to large radius": (STEEL, GREAT, 1.5e-3, "partial reflection"),
    "hard to soft (steel to PTFE)": (STEEL, PTFE, 2.2e-3, "train"),
    "soft to hard (PTFE to steel)": (PTFE, STEEL, 2.6e-3, "partial reflection"),
    "hard to soft, equal masses": (STEEL, SOFT, 2.4e-3, "train"),
    "soft to hard, equal masses": (SOFT, STEEL, 2.4e-3, "partial reflection"),
}
SPEED = 0.5  # m/s, of a striker like the first bead
ROWS, KEPT = 1600, 400  # instants of a run and of a density
SENSOR = 15  # beads behind the step
PRELOADS, BLOW, LONG = (0.0, 20.0), 0.05, 3e-3  # N, m/s, s: of a step that is a diode


def struck(beads, t_end, speed):
    """A run of a chain, free at its end, that a bead like its first hits."""
    scene = chain(beads, striker=Striker(beads[0], speed))
    impacts = [(b.mass**2 / (hertz(b, b).constant ** 2 * SPEED)) ** 0.2 for b in set(beads)]
    steps = int(25 * t_end / min(impacts))  # 25 in the time of an impact
    record = Record(every=max(1, steps // ROWS))
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=t_end / steps, record=record)


def data(by=1.0):
    """Energy density of each scene, over that of the striker, the force behind its step, the
    transmitted energy.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {}
    for name, (first, second, t_end, _) in SCENES.items():
        run = struck([first] * BEFORE + [second] * AFTER, t_end, by * SPEED)
        some = slice(None, None, max(1, len(run.t) // KEPT))
        density = run.scene.site_energy(State(run.u[some], run.v[some])) / run.energy[0]
        tables[f"{name} density"] = {"t [s]": run.t[some]}
        tables[f"{name} density"] |= {f"site {k}": x for k, x in enumerate(density.T)}
        tables[f"{name} sensors"] = {
            "t [s]": run.t,
            "behind the step [N]": run.scene.contact_forces(run.u)[:, BEFORE + SENSOR],
            "energy beyond": run.scene.site_energy(run)[:, BEFORE + 1 :].sum(1) / run.energy[0],
        }
    for way, pair in (("steel to PTFE", (STEEL, PTFE)), ("PTFE to steel", (PTFE, STEEL))):
        found = [passed(*pair, preload, by * BLOW) for preload in PRELOADS]
        tables.setdefault("diode", {"preload [N]": PRELOADS})[way] = found
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
    lines = {}
    for name, (_, _, _, said) in SCENES.items():
        t, force, beyond = tables[f"{name} sensors"].values()
        count = len(peaks(t, force, LEVEL)[1])
        lines[f"{name}: pulses above 5 % behind the step"] = count, said
        lines[f"{name}: energy beyond it as the largest passes"] = beyond[np.argmax(force)]
    (_, preloads), *ways = tables["diode"].items()
    for k, preload in enumerate(preloads):
        for way, found in ways:
            lines[f"{way}, preload {preload:g} N: energy that passes the step"] = found[k]
    return _guide.rows("steps", lines)


def draw(figure, tables):
    """Energy densities, two scenes per row."""
    from matplotlib.colors import LogNorm

    figure.set_size_inches(9, 9.5)
    panels = figure.subplots(3, 2)
    for axes, name in zip(panels.flat, SCENES, strict=True):
        image = _guide.draw_density(axes, tables[f"{name} density"], [BEFORE], name, 1e-3, first=0,
                                    norm=LogNorm(1e-4, 1, clip=True))  # fmt: skip
        axes.set(xlabel="site", ylabel="time [ms]")
    figure.colorbar(image, ax=panels, label="energy over that of the striker", shrink=0.6)
