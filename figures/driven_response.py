"""Responses of driven and damped chains, followed through their folds, with what is stable.

A prism on a held base is driven by a force; ten beads, one of them light, stand between a wall that
moves and one that does not.  Multipliers of each response say whether it is stable: it loses that
at folds, and at torus points, beyond which motion is quasi-periodic.  Where the light bead is next
to the moving wall, waves pass beyond such a point; turned round, the chain keeps them out.
Source: Boechler, Theocharis & Daraio 2011, Bifurcation-based acoustic switching and rectification,
for the chain of beads.
"""

from functools import cache

import numpy as np
import sympy as sp

from figures._files import side_by_side
from tensegrity import (
    Chain,
    Damping,
    Drive,
    PowerLaw,
    Prism,
    Record,
    orbit_path,
    periodic_orbit,
    simulate,
)

NAME = "driven_response"
GROUP = "driven"

FORCES = (0.0003, 0.0006, 0.001)  # N
GROUND, RANGE = 0.02, (1.55, 1.8)  # N s/m, rad/s
BEADS, LIGHT, MOVED, LOSS = 10, 0.5, 0.02, 0.005
SWEPT = (2.83, 2.75)
SIDES = {"light bead near the drive": 2, "light bead at the far end": 9}
NAMED = ((0.0078, 1.2e-6), (0.0129, 1e-10))  # where they are named
TURNED, STRENGTHS = 2.81, np.geomspace(0.002, 0.06, 12)  # rad/s, m
SETTLED, END, STEP = 1500.0, 3000.0, 0.05  # s
FREQUENCY = "frequency of the drive [rad/s]"
W, T, SIZE = sp.symbols("W t A")


def prism(force):
    """A prism on a held base, driven by a force."""
    drive = Drive(force=force * sp.cos(W * T), parameters={"W": RANGE[0]})
    spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
    return Chain(
        spring, 2, ends=("fixed", "free"), drive={1: drive}, damping=Damping(ground=GROUND)
    )


def beads(drive, light=2):
    """Beads between walls, one of them light, the first wall moving; scaled Hertz contacts."""
    mass = np.ones(BEADS + 2)
    mass[light] = LIGHT
    return Chain(PowerLaw(1.0, 1.5, preload=1.0), BEADS + 2, mass, ("free", "fixed"),
                 drive={0: drive}, damping=Damping(ground=LOSS))  # fmt: skip


@cache
def followed(name):
    """The path of a scene by the frequency, or by the strength of the drive for a side."""
    if name in SIDES:
        wall = Drive(displacement=SIZE * sp.cos(TURNED * T), parameters={"A": float(STRENGTHS[0])})
        scene, by, until = beads(wall, SIDES[name]), "A", float(STRENGTHS[-1])
    elif name == "beads":
        wall = Drive(displacement=MOVED * sp.cos(W * T), parameters={"W": SWEPT[0]})
        scene, by, until = beads(wall), "W", SWEPT[1]
    else:
        scene, by, until = prism(name), "W", RANGE[1]
    return orbit_path(periodic_orbit(scene, scene.at_rest()), by=by, until=until)


def transmitted(light, strength):
    """Mean kinetic energy of the last bead in a run that begins at rest [J]."""
    grown = 1 - sp.exp(-((T / 50) ** 2))
    scene = beads(Drive(displacement=float(strength) * grown * sp.cos(TURNED * T)), light)
    run = simulate(scene, scene.at_rest(), END, method="verlet", dt=STEP, record=Record(every=5))
    return float(np.mean(run.v[run.t > SETTLED][:, BEADS] ** 2) / 2)


def data():
    tables = {}
    for name in (*FORCES, "beads"):
        path = followed(name)
        tables[f"path {name}"] = {"W": path.columns["W"], "amplitude": path.amplitude,
                                  "stable": np.asarray(path.stable, float)}  # fmt: skip
        tables[f"events {name}"] = side_by_side(
            [
                {"kind": one.kind, "W": float(one.value), "amplitude": float(one.amplitude)}
                for one in path.events
            ]
        )
    tables["transmitted"] = {"drive": STRENGTHS} | {
        side: np.array([transmitted(light, a) for a in STRENGTHS]) for side, light in SIDES.items()
    }
    lost = [[event.value for event in followed(side).events][:1] or [np.nan] for side in SIDES]
    tables["lost"] = {"side": list(SIDES), "drive": np.array(lost)[:, 0]}
    return tables


def response(ax, tables, name, color):
    """A path: what is not stable dashed, events as points."""
    w, amplitude, stable = tables[f"path {name}"].values()
    for chosen, style in ((stable > 0, "-"), (stable == 0, "--")):
        near = chosen | np.append(chosen[1:], False) if style == "--" else chosen
        ax.plot(w, np.where(near, amplitude, np.nan), color, ls=style, lw=1.2)
    kinds, places, heights = tables[f"events {name}"].values()
    for kind, x, y in zip(kinds, places, heights, strict=True):
        ax.plot([x], [y], {"fold": "ko", "torus": "ks"}.get(kind, "kx"), ms=5, mfc="w")


def draw(figure, tables):
    figure.set_size_inches(9, 6.4)
    axes = figure.subplot_mosaic([["prism", "beads"], ["sent", "sent"]])
    prisms, row, sent = axes.values()
    for k, force in enumerate(FORCES):
        response(prisms, tables, force, f"C{k}")
        w, amplitude, _ = tables[f"path {force}"].values()
        at = int(np.argmax(amplitude))
        place = w[at] - (0.0, 0.024, 0.008)[k], amplitude[at] - (0.0105, 0.0, 0.0)[k]
        prisms.annotate(f"{1e3 * force:g} mN", place, color=f"C{k}", ha="right" if k else "center")
    prisms.set(xlabel=FREQUENCY, ylabel="amplitude [m]", title="A prism's response folds over")
    prisms.set_ylim(bottom=-0.0025)
    response(row, tables, "beads", "C0")
    for words, place in (("fold", (2.8, 0.18)), ("torus point", (2.816, 0.235)),
                         ("unstable", (2.773, 0.29))):  # fmt: skip
        row.annotate(words, place)
    row.set(xlabel=FREQUENCY, ylabel="amplitude of a bead [m]",
            title="Ten beads lose stability in two ways")  # fmt: skip
    drive, *found = tables["transmitted"].values()
    for k, (values, side, place) in enumerate(zip(found, SIDES, NAMED, strict=True)):
        sent.loglog(drive, values, f"C{3 * k}o-", ms=4)
        sent.annotate(side, place, color=f"C{3 * k}")
    lost = tables["lost"]["drive"][0]
    sent.xaxis.set_minor_formatter("")
    sent.axvline(lost, color="0.5", ls=":")
    sent.annotate("torus point", (0.98 * lost, 3e-3), color="0.4", ha="right")
    sent.set(xlabel="amplitude of the drive [m]", ylabel="energy of the last bead [J]",
             title="Beyond a torus point waves pass one way, not the other")  # fmt: skip


def table(tables):
    rows = []
    for words, name in ((f"prism, {1e3 * FORCES[-1]:g} mN", FORCES[-1]), ("ten beads", "beads")):
        kinds, frequencies, _ = tables[f"events {name}"].values()
        rows += [
            {"response": f"{words}, {kind}", "frequency [rad/s]": w}
            for kind, w in zip(kinds, frequencies, strict=True)
        ]
    rows += [{"response": f"{side}, loses stability at a drive of",
              "drive": "none" if np.isnan(lost) else float(lost)}
             for side, lost in zip(*tables["lost"].values(), strict=True)]  # fmt: skip
    _, ahead, back = tables["transmitted"].values()
    words = "transmitted energy, one way over the other"
    return [*rows, {"response": words, "ratio": (ahead / back).max()}]
