"""The energy that a light mass in a chain of prisms traps from a wave is that of its breather.

A solitary wave passes a mass half as heavy as the others and leaves an oscillation there, above the
band, which persists.  Its energy and frequency are measured late in a run, and its states are
projected on those of the periodic orbit that continues the mode of the defect, at the same energy,
in the inner product of the linear chain's energy.  A heavy mass has no such orbit.
"""

import math
from functools import cache
from types import SimpleNamespace

import numpy as np

import tensegrity as ts
from figures._files import lines
from figures._tables import arrays

GROUP = "waves"

SPRING = ts.Prism(base=1.0, height=0.7, prestrain=0.1, k_cross=1.0).potential()
LIGHT, HEAVY = 0.5, 2.0  # kg
SITES, MIDDLE, BEHIND, WINDOW, NEAR = 1201, 600, 40, 20, 8
RATIOS = (1.2, 1.4, 1.6, 1.8)  # speeds over that of sound
LATE, LAST, STEP = 250.0, 20.0, 0.025  # s
SHOWN = 1.6


def chain(mass, sites=SITES):
    """Prisms with another mass in the middle."""
    masses = np.ones(sites)
    masses[sites // 2] = mass
    return ts.Chain(SPRING, sites, masses)


@cache
def struck(mass, ratio):
    """A wave that has passed the middle: the run near it, late, and the wave's energy [J]."""
    scene, wave = chain(mass), ts.solitary_wave(SPRING, speed_ratio=ratio)
    near = range(MIDDLE - WINDOW, MIDDLE + WINDOW + 1)
    start = wave.launch(scene, at=MIDDLE - BEHIND)
    run = ts.simulate(scene, start, LATE + LAST, method="rkn6", dt=STEP,
                   record=ts.Record(every=1, sites=near))  # fmt: skip
    late = run.t > LATE
    return SimpleNamespace(t=run.t[late], u=run.u[late], v=run.v[late]), wave.energy


def trapped(run, mass):
    """Energy within a few sites of the middle at the recorded times [J]."""
    part = chain(mass, 2 * WINDOW + 1)
    return part.site_energy(run)[:, WINDOW - NEAR : WINDOW + NEAR + 1].sum(axis=1)


@cache
def family():
    """The mode of the defect, followed in its energy."""
    scene, x = chain(LIGHT, 2 * WINDOW + 1), np.arange(-WINDOW, WINDOW + 1)
    linear = math.sqrt(4 * float(SPRING.stiffness(0.0)) / (LIGHT * (2 - LIGHT))) / (2 * math.pi)
    guess = ts.State(0.0091 * (-LIGHT / (2 - LIGHT)) ** np.abs(x), 0.0 * x)
    first = ts.periodic_orbit(scene, guess, period=1 / (1.005 * linear))
    return ts.orbit_path(first, by="energy", until=0.012), linear


def breather(energy):
    """The orbit of an energy [J]."""
    path, _ = family()
    nearest = path.orbits[int(np.argmin(np.abs(path.energy - energy)))]
    return ts.periodic_orbit(nearest.scene, nearest, energy=energy)


def share(run, orbit):
    """Mean over the recorded states of the part of their energy along the orbit's nearest one."""
    whole = ts.simulate(
        orbit.scene, orbit.state, orbit.period, tol=1e-8,
        record=ts.Record(times=np.linspace(0, orbit.period, 400)),
    )  # fmt: skip
    stiffness, mass = float(SPRING.stiffness(0.0)), orbit.scene.mass

    def scaled(u, v):
        return np.hstack([np.sqrt(stiffness) * np.diff(u, axis=1), np.sqrt(mass) * v])

    here, there = scaled(run.u, run.v), scaled(whole.u, whole.v)
    along = here @ there.T / np.linalg.norm(there, axis=1)
    return float(np.mean(along.max(axis=1) ** 2 / np.sum(here**2, axis=1)))


def frequency(run):
    """Of the middle mass's velocity, from its zeros [Hz]."""
    v, t = run.v[:, WINDOW], run.t
    k = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))
    zeros = t[k] - v[k] * (t[k + 1] - t[k]) / (v[k + 1] - v[k])
    return (len(zeros) - 1) / (zeros[-1] - zeros[0])


def data():
    rows = []
    for ratio in RATIOS:
        run, energy = struck(LIGHT, ratio)
        left = float(np.mean(trapped(run, LIGHT)))
        heavy, orbit = float(np.mean(trapped(struck(HEAVY, ratio)[0], HEAVY))), breather(left)
        rows.append({
            "speed ratio": ratio, "energy of the wave": energy, "trapped": left / energy,
            "at a heavy mass": heavy / energy, "on the breather": share(run, orbit),
            "frequency in the run": frequency(run), "frequency of the breather": 1 / orbit.period,
            "energy trapped": left,
        })  # fmt: skip
        if ratio == SHOWN:
            peak = int(np.argmax(np.abs(run.u[:, WINDOW] - run.u.mean(axis=1))))
            shapes = {"site": np.arange(-WINDOW, WINDOW + 1)}
            for name, u in (("run", run.u[peak]), ("breather", orbit.state.u)):
                shapes[name] = u - u.mean()
            largest = float(np.abs(ts.floquet(orbit).multipliers[0]))
    path, linear = family()
    followed = {"energy": path.energy, "frequency": 1 / path.period, "multiplier": path.multiplier}
    return {
        "struck": arrays(rows), "family": followed, "shape": shapes,
        "linear": {"frequency": [linear], "largest modulus": [largest]},
    }  # fmt: skip


def draw(figure, tables):
    figure.set_size_inches(9, 3.4)
    shape, curve, part = figure.subplots(1, 3)
    site, run, orbit = tables["shape"].values()
    shape.plot(site, run, "C0-", lw=1.2, label="run, when largest")
    shape.plot(site, orbit, "ko", ms=4, mfc="none", label="breather")
    shape.set(xlabel="site, from the light one", ylabel="displacement [m]")
    shape.set(xlim=(-12, 12), ylim=(-0.011, 0.026), title="What stays is a breather in shape")
    shape.legend(fontsize=9, loc="upper left")
    curve.plot(tables["family"]["energy"], tables["family"]["frequency"], "k-", lw=1.2)
    curve.plot(tables["struck"]["energy trapped"], tables["struck"]["frequency in the run"], "C0o")
    curve.annotate("breather", (0.0063, 0.656), ha="right")
    curve.annotate("runs", (0.0024, 0.622), color="C0")
    curve.set(xlabel="energy near the light mass [J]", ylabel="frequency [Hz]")
    curve.set(xticks=[0, 0.004, 0.008, 0.012], title="and in frequency")
    ratio = tables["struck"]["speed ratio"]
    for name, color in (("trapped", "C0"), ("at a heavy mass", "C3")):
        part.semilogy(ratio, tables["struck"][name], f"{color}o-")
    part.annotate("light mass", (ratio[1], 0.025), color="C0")
    at = ratio[1], tables["struck"]["at a heavy mass"][1] * 1.6
    part.annotate("heavy mass", at, color="C3")
    part.set(xlabel="speed over that of sound", ylabel="part of the wave's energy")
    part.set_title("Heavy masses trap nothing")


def table(tables):
    for line in lines(tables["struck"]):
        wave = f"{line.pop('speed ratio'):g} times the speed of sound"
        yield {"wave": wave} | {name: float(value) for name, value in line.items()}
