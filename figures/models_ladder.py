"""For each accuracy there is a simplest sufficient model, far cheaper than the largest."""

import math

import numpy as np

from figures._guide import STEEL, light
from figures._limits import moved, stepped
from figures._nodes import Nodes
from granular import chain as bead_chain
from granular import hertz, simulate, y_guide
from tensegrity import Chain, Polynomial, PowerLaw, Prism, compare_models

NAME = "models_ladder"
GROUP = "models"

FLOOR = 1e-15  # smallest error that is drawn

LEVELS = (1e-2, 1e-4, 1e-8)
ELASTIC = Prism(base=1.0, height=0.8, prestrain=0.02, k_cross=1.0, k_base=1000.0, k_bar=10000.0)
RIGID = Prism(ELASTIC.base, ELASTIC.height, ELASTIC.prestrain, ELASTIC.k_cross)
FITS = (1e-3, 1e-6, 1e-10)  # errors of polynomials, relative to the largest tension
SITES, BLOW, T_END, STEPS = 30, dict.fromkeys(range(4), 0.03), 20.0, 100
STEM, BRANCH, SPEED, ANGLE = 19, 23, 0.585, math.pi / 6
DT_GUIDE, FINER = 0.05e-6, 2
GUIDES = {"stem": 110e-6, "stem_and_junction": 250e-6}  # durations [s]
LOADED = np.linspace(0.0, -0.035, 200)  # elongations of the prism under load [m]


def ladder(models, reference):
    """Errors of models, relative to the largest of the reference, and times over the slowest.

    Parameters
    ----------
    models : dict of str to callable
        Each returns what `reference` is: an array.
    """
    *rows, _ = compare_models(models | {"reference": lambda: reference}).rows
    slowest = max(row.seconds for row in rows)
    return {
        "model": [row.model for row in rows],
        "error": np.array([row.error for row in rows]),
        "time": np.array([row.seconds / slowest for row in rows]),
    }


def prisms_in_a_row():
    """Displacements of a chain of elastic prisms some time after a blow."""
    spring, rigid, dt = ELASTIC.potential(), RIGID.potential(), T_END / STEPS

    def run(one, finer=1):
        row = Chain(one, SITES)
        return moved(row, row.at_rest(BLOW), "rkn6", dt / finer, finer * STEPS)[0]

    def nodes():
        row, prisms = Chain(spring, SITES), Nodes(ELASTIC, SITES - 1)

        def acceleration(u):
            tension = prisms.tension(ELASTIC.height + row.elongation(u))
            return np.diff(tension, prepend=0.0, append=0.0)

        state = row.at_rest(BLOW)
        return stepped(acceleration, state.u, state.v, "rkn6", dt, STEPS)[0]

    row = Chain(spring, SITES)
    visited = simulate(row, row.at_rest(BLOW), T_END, dt=dt, method="rkn6").elongation_range[0]
    fits = {error: Polynomial(spring, *(1.05 * visited), error) for error in FITS}
    models = {"rigid": lambda: run(rigid)}
    models |= {f"elastic, degree {p.degree}": (lambda p=p: run(p)) for p in fits.values()}
    models |= {"elastic, exact": lambda: run(spring), "18 coordinates": nodes}
    return ladder(models, run(spring, finer=4))


def guide(t_end):
    """Velocities of the beads of a half guide along their parts: stem and one branch."""
    way = np.array([math.cos(ANGLE), math.sin(ANGLE)])
    steps = round(t_end / DT_GUIDE)

    def bare(scene, state, finer=1):
        return moved(scene, state, "rkn6", t_end / steps / finer, finer * steps)[1]

    def straight():
        scene = bead_chain([STEEL] * (STEM + BRANCH), striker=light(SPEED))
        return bare(scene, scene.start())

    def folded():
        """Both branches as one row.

        A branch bead at y cos(angle) along its axis is pressed by the last bead of the stem as if
        at y in line with it: energies and masses of both branches, in y, are those below.
        """
        cosine, alpha, n = math.cos(ANGLE), hertz(STEEL, STEEL).constant, 1.5
        stem = PowerLaw(alpha, n)
        branch = PowerLaw(2 * alpha * cosine ** (n + 1), n)
        masses = [STEEL.mass] * (1 + STEM) + [2 * STEEL.mass * cosine**2] * BRANCH
        row = Chain([stem] * STEM + [branch] * BRANCH, 1 + STEM + BRANCH, masses)
        v = bare(row, row.at_rest({0: SPEED}))
        v[1 + STEM :] *= cosine
        return v

    def plane(finer=1):
        scene = y_guide(STEM, BRANCH, ANGLE, bead=STEEL, striker=light(SPEED))
        v = bare(scene, scene.start(), finer)
        order = [s for part in ("striker", "stem 1", "branch 1") for s in scene.parts[part]]
        along = v[: scene.sites] @ way
        along[: 1 + STEM] = v[: 1 + STEM, 0]
        return along[order]

    models = {"1D, straight on": straight, "1D, branches as one": folded, "2D": plane}
    return ladder(models, plane(FINER))


def under_load():
    """Load of a prism pressed from its reference, at many heights."""
    rigid, soft = RIGID.potential(), ELASTIC.potential()
    fits = [Polynomial(soft, 1.01 * LOADED[-1], 1e-3, error) for error in FITS]
    nodes = Nodes(ELASTIC, len(LOADED))
    models = {"rigid": lambda: rigid.tension(LOADED)}
    models |= {f"elastic, degree {p.degree}": (lambda p=p: p.tension(LOADED)) for p in fits}
    models["elastic, exact"] = lambda: soft.tension(LOADED)
    models["18 coordinates"] = lambda: Nodes(ELASTIC, len(LOADED)).tension(ELASTIC.height + LOADED)
    return ladder(models, nodes.tension(ELASTIC.height + LOADED))


def data():
    """A ladder of models for each scene."""
    return {
        "chain_of_prisms": prisms_in_a_row(),
        **{f"guide_{name}": guide(t_end) for name, t_end in GUIDES.items()},
        "prism_under_load": under_load(),
    }


def enough(ladder, level):
    """The first, simplest, model whose error is at most that, and its time; or "none"."""
    good = np.flatnonzero(ladder["error"] <= level)
    if good.size == 0:
        return "none"
    return f"{ladder['model'][good[0]]} ({ladder['time'][good[0]]:.0e})"


def table(tables):
    """Which model suffices in each scene, and its time over that of the largest."""
    return [
        {"scene": scene.replace("_", " ")} | {f"for {x:g}": enough(one, x) for x in LEVELS}
        for scene, one in tables.items()
    ]


def draw(figure, tables):
    """Error against time in each scene, every model by its name."""
    figure.set_size_inches(9, 7)
    panels = figure.subplots(2, 2, sharey=True)
    for axes, (scene, one) in zip(panels.flat, tables.items(), strict=True):
        low, high = one["time"].min(), one["time"].max()
        middle, last = np.sqrt(low * high), np.inf
        for name, error, seconds in sorted(zip(*one.values(), strict=True), key=lambda x: -x[1]):
            height = max(error, FLOOR)
            axes.loglog(seconds, height, "C0v" if error < FLOOR else "C0o", ms=6)
            at, is_late = np.log10(height), seconds > middle
            last = min(at, last - 1)  # a decade is as high as a name
            axes.annotate(
                f"{name}, reference" if error == 0 else name, (seconds, height),
                (-7 if is_late else 7, 11 * (last - at)), textcoords="offset points",
                ha="right" if is_late else "left", va="center", fontsize=8,
            )  # fmt: skip
        for level in LEVELS:
            axes.axhline(level, color="0.6", lw=0.7, ls=":")
        room = max((high / low) ** 0.6, 3.0)
        axes.set(
            xlim=(low / room, high * room), ylim=(FLOOR / 1e4, 30), title=scene.replace("_", " ")
        )
    figure.supxlabel("time over that of the slowest model", fontsize=10)
    figure.supylabel("error, relative to the largest value (triangles: below 1e-15)", fontsize=10)
