"""Dashpots slow fronts on two wells, the lattice slows them further, and pins them at last.

Springs k join sites of mass 1 with the force u (u - a)(u - 1) to the ground.  In the continuum
c = sqrt(k) v/sqrt(g^2 + v^2), v = (1 - 2a)/sqrt(2) (N. Nadkarni et al., Phys. Rev. Lett. 116,
244501 (2016)); on the lattice the speed is that of `transition_wave`, confirmed by runs.  The
threshold of a, beyond which a chain holds a standing front, depends on k alone.
"""

import numpy as np
import sympy as sp
from scipy.optimize import brentq

from figures._draw import note
from figures._scenes import linear
from tensegrity import Chain, Damping, Potential, Record, simulate, transition_wave
from tensegrity.waves.transition import standing_forces

GROUP = "waves"

COUPLINGS = (0.1, 0.25, 1.0)  # N/m
DASHPOTS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.3, 1.6, 1.9, 2.3, 2.8)  # N s/m, with WELL
WELL = 0.3  # a
WELLS = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.43, 0.45, 0.47)  # with DASHPOT
DASHPOT = 0.8  # N s/m
SITES, AT, PASSED = 260, 110, 60  # of a run; place of the front, and sites that it passes
NAMES = {0.1: (0.42, 0.02), 0.25: (1.0, 0.15), 1.0: (1.1, 0.26)}  # places of names
TESTED = {0.1: (0.7, 1.9), 0.25: (0.7,), 1.0: (0.9,)}  # dashpots of runs


def wells(a):
    """The spring to the ground."""
    u, s = sp.symbols("u a")
    return Potential(u**2 * (3 * u**2 - 4 * (1 + s) * u + 6 * s) / 12, u, {"a": a})


def front(k, a, g):
    """The front of a chain with these springs and dashpots."""
    damping = Damping(ground=g)
    return transition_wave(linear(k), ahead=0.0, behind=1.0, ground=wells(a), damping=damping)


def continuum(k, a, g):
    """Speed in the continuum [sites/s]."""
    v = (1 - 2 * np.asarray(a)) / np.sqrt(2)
    return np.sqrt(k) * v / np.sqrt(np.asarray(g) ** 2 + v**2)


def threshold(k):
    """The least a at which the chain holds a standing front."""
    return brentq(lambda a: standing_forces(linear(k), wells(a), 0.0, 1.0)[1], 0.3, 0.5, xtol=1e-12)


def measured(k, a, g):
    """Speed in a run that starts from a step [sites/s]."""
    chain = Chain(linear(k), SITES, ground=wells(a), damping=Damping(ground=g))
    state = front(k, a, g).launch(chain, at=AT, tail=1e-3)
    rough = type(state)(np.round(state.u), 0 * state.v)
    end = 2 * PASSED / continuum(k, a, g)
    run = simulate(chain, rough, end, tol=1e-7, record=Record(times=np.linspace(0, end, 2001)))
    passed = [run.t[np.flatnonzero(run.u[:, AT + n] > 0.5)[0]] for n in (PASSED // 3, PASSED)]
    return (PASSED - PASSED // 3) / (passed[1] - passed[0])


def data():
    """Speeds by dashpot and by the place of the barrier, thresholds and runs."""
    tables = {}
    for k in COUPLINGS:
        fronts, limit = [front(k, WELL, g) for g in DASHPOTS], threshold(k)
        found = {
            name: np.array([getattr(x, name) for x in fronts]) for name in ("speed", "residual")
        }
        tables[f"k = {k:g}, dashpots"] = {"dashpot": np.array(DASHPOTS)} | found
        below = np.array([a for a in WELLS if a < limit - 0.004])
        speeds = np.array([front(k, a, DASHPOT).speed for a in below])
        tables[f"k = {k:g}, barriers"] = {"a": below, "speed": speeds}
        tables[f"k = {k:g}, pinned"] = {"from a": np.array([limit])}
        speeds = np.array([measured(k, WELL, g) for g in TESTED[k]])
        tables[f"k = {k:g}, runs"] = {"dashpot": np.array(TESTED[k]), "speed": speeds}
    return tables


def draw(figure, tables):
    """Speed against the dashpots on the left, against the place of the barrier on the right."""
    figure.set_size_inches(11, 4.8)
    left, right = figure.subplots(1, 2)
    g, a = np.linspace(0.4, 3.0, 200), np.linspace(0.05, 0.5, 200)
    for number, k in enumerate(COUPLINGS):
        color = f"C{number}"
        left.plot(g, continuum(k, WELL, g), color, ls="--", lw=1)
        right.plot(a, continuum(k, a, DASHPOT), color, ls="--", lw=1)
        dashpot, speed, _ = tables[f"k = {k:g}, dashpots"].values()
        left.plot(dashpot, speed, color, marker="o", ms=4)
        left.annotate(f"k = {k:g} N/m", NAMES[k], color=color)
        left.plot(*tables[f"k = {k:g}, runs"].values(), "kx", ms=9, mew=1.5)
        right.plot(*tables[f"k = {k:g}, barriers"].values(), color, marker="o", ms=4)
        limit = tables[f"k = {k:g}, pinned"]["from a"][0]
        right.plot([limit], [0], color, marker="s", ms=6, clip_on=False, zorder=9 - number)
    note(left, "dashed: continuum", (0.95, 0.93), inside=True, ha="right", color="0.4")
    note(left, "crosses: runs from a step", (0.95, 0.86), inside=True, ha="right")
    right.annotate("pinned from\nthe square on", (0.41, 0.2), ha="left", color="0.3")
    left.set(xlabel="dashpot to the ground g [N s/m]", ylabel="speed [sites/s]", ylim=(0, None))
    left.set_title(f"barrier at a = {WELL:g}")
    right.set(xlabel="place of the barrier a [m]", ylabel="speed [sites/s]", ylim=(0, None))
    right.set_title(f"dashpot g = {DASHPOT:g} N s/m; equal wells at a = 1/2")


def table(tables):
    """Loss of speed by the lattice, and thresholds."""
    for k in COUPLINGS:
        dashpot, speed, residual = tables[f"k = {k:g}, dashpots"].values()
        ratio = speed / continuum(k, WELL, dashpot)
        run = tables[f"k = {k:g}, runs"]
        off = run["speed"] / speed[np.searchsorted(dashpot, run["dashpot"])] - 1
        yield {
            "k [N/m]": k,
            "least speed over that of the continuum": float(ratio.min()),
            "largest": float(ratio.max()),
            "pinned from a [m]": float(tables[f"k = {k:g}, pinned"]["from a"][0]),
            "runs off by": float(np.abs(off).max()),
            "largest residual": float(residual.max()),
        }
