"""Where the energy of exact waves falls with their speed they are unstable: multipliers, and runs.

The force r + r^7 carries slow waves that are wide and have much energy.  Their energy has a minimum
at 1.0314 times the sound speed, where the largest Floquet multiplier passes 1.  A run begins with a
wave of 1.02 times the sound speed, plus and minus a small part of its unstable mode: the deviation
grows as the multiplier says, then one wave speeds up towards the stable ones and the other spreads.
On a ring, waves meet their own radiation, and a stable wave seems to be unstable.
"""

from functools import cache

import numpy as np
import sympy as sp

from figures._tables import arrays
from tensegrity import METHODS, Chain, Potential, State, floquet, predict, simulate, solitary_wave

GROUP = "waves"

R = sp.Symbol("r")
LAW = Potential(R**2 / 2 + R**8 / 8, R)
SPEEDS = np.concatenate([np.linspace(1.014, 1.03, 9), np.linspace(1.032, 1.05, 10)])
UNSTABLE, STABLE = 1.02, 1.05  # speeds [sites/s] of the run, and of the ring
WINDOW, RING, FINE = 111, 60, 16  # sites; sites; steps per site passed
MODE, LAP, PASSED = 1e-6, 20, 5600  # m; sites between two looks at a run; sites in all
FIRST, LAST = 1000, 3000  # sites passed between which the growth is measured
METHOD = METHODS["rkn6"]


def passed(wave, sites, ring):
    """The tangent of the map "run for 1/c, then move back by one site", and the sites' places.

    In an open window nothing lies ahead, and what is behind is dropped.
    """
    x, dt = np.arange(sites) - sites // 2, 1 / (FINE * wave.speed)
    bonds = np.roll(np.eye(sites), 1, axis=1) - np.eye(sites)
    if not ring:
        bonds = bonds[:-1]
    u, v = np.eye(2 * sites).reshape(2, sites, 2 * sites)
    for step in range(FINE):
        t = step * dt
        for kick, drift in zip(METHOD.kicks, (*METHOD.drifts, 0.0), strict=True):
            here = x - wave.speed * t
            k = LAW.stiffness(wave.displacement(here + 1) - wave.displacement(here))
            v = v - kick * dt * (bonds.T @ (k[: len(bonds), None] * (bonds @ u)))
            u, t = u + drift * dt * v, t + drift * dt
    moved = [np.roll(one, -1, axis=0) for one in (u, v)]
    if not ring:
        for one in moved:
            one[-1] = 0.0
    return np.concatenate(moved), x


def mode():
    """The unstable mode of the slow wave, largest displacement 1, (2, window)."""
    tangent, _ = passed(solitary_wave(LAW, speed=UNSTABLE), WINDOW, False)
    values, vectors = np.linalg.eig(tangent)
    found = vectors[:, int(np.argmax(values.real))].real.reshape(2, WINDOW)
    return found / np.abs(found[0]).max() * np.sign(found[0, WINDOW // 2])


def seen(x, u):
    """Place of a wave, and its peak elongation, between the sites too."""
    r = np.abs(np.diff(u))
    finer = np.fft.irfft(np.fft.rfft(r), 16 * len(r)) * 16
    return np.sum(x[:-1] * r**4) / np.sum(r**4), finer.max()


@cache
def perturbed(sign):
    """Sites passed, how far the wave is ahead of the exact one, and its peak elongation."""
    wave, chain = solitary_wave(LAW, speed=UNSTABLE), Chain(LAW, WINDOW + LAP)
    x = np.arange(WINDOW + LAP) - WINDOW // 2
    state = np.array([wave.displacement(x), -wave.speed * wave.rate(x)])
    exact, _ = seen(x, state[0])
    state[:, :WINDOW] += sign * MODE * mode()
    rows = []
    for lap in range(PASSED // LAP + 1):
        place, peak = seen(x, state[0])
        rows.append((lap * LAP, place - exact, peak))
        if abs(place - exact) > LAP:
            break
        run = simulate(chain, State(*state), LAP / wave.speed, method="rkn6",
                       dt=1 / (FINE * wave.speed))  # fmt: skip
        state = np.pad([run.final.u[LAP:], run.final.v[LAP:]], ((0, 0), (0, LAP)))
    return dict(zip(("sites", "ahead", "peak"), np.transpose(rows), strict=True))


def data():
    rows = []
    for speed in SPEEDS:
        wave = solitary_wave(LAW, speed=float(speed))
        rows.append({"speed": speed, "energy": wave.energy, "slope": wave.energy_slope,
                     "multiplier": floquet(wave).multipliers[0].real})  # fmt: skip
    ((_, change),) = predict(LAW)["compression"].unstable()
    slow, least, fast = (solitary_wave(LAW, speed=c) for c in (UNSTABLE, change, STABLE))
    tables = {
        "family": arrays(rows), "change": {"speed": [change], "energy": [least.energy]},
        "mode": {"multiplier": [floquet(slow).multipliers[0].real]},
    }  # fmt: skip
    for name, sites, ring in (("ring", RING, True), ("window", RING + 1, False)):
        values = np.linalg.eigvals(passed(fast, sites, ring)[0])
        tables[name] = {"angle": np.abs(np.angle(values)), "modulus": np.abs(values)}
    return tables | {f"run {sign:+d}": perturbed(sign) for sign in (1, -1)}


def growth(run):
    """Logarithm of the growth of a deviation per site, between FIRST and LAST."""
    first, last = (int(np.searchsorted(run["sites"], x)) for x in (FIRST, LAST))
    grown = np.log(run["ahead"][last] / run["ahead"][first])
    return float(grown / (run["sites"][last] - run["sites"][first]))


def draw(figure, tables):
    figure.set_size_inches(9, 6)
    axes = figure.subplot_mosaic([["energy", "multiplier", "ring"], ["grown", "grown", "peak"]])
    energy, multiplier, rings, grown, peak = axes.values()
    speed, joule, _, factor = tables["family"].values()
    (change,), (least,) = tables["change"].values()
    slow = speed < change
    for ax, y, at in ((energy, joule, least), (multiplier, factor, 1.0)):
        ax.plot([*speed[slow], change], [*y[slow], at], "C3--")
        ax.plot([change, *speed[~slow]], [at, *y[~slow]], "C0-")
        ax.plot([change], [at], "ko", ms=4)
        ax.set_xlabel("speed [sites/s]")
    energy.set(ylabel="energy [J]", title="The energy has a minimum")
    energy.annotate("unstable", (1.0205, 1.264), color="C3")
    energy.annotate("stable", (1.0405, 1.2485), color="C0")
    multiplier.axhline(1, color="0.6", lw=0.8)
    multiplier.set(ylabel="multiplier per site", title="Slower waves are unstable")
    for name, style, face in (("ring", "C1o", "none"), ("window", "C0.", "C0")):
        angle, modulus = tables[name].values()
        rings.plot(angle / np.pi, modulus, style, ms=4, mfc=face)
    rings.annotate("ring of 60 sites", (0.3, 1.0042), color="C1")
    rings.annotate("open window", (0.35, 0.9915), color="C0")
    rings.set(xlabel="angle of the multiplier [π]", ylabel="modulus, at 1.05 sites/s")
    rings.set(ylim=(0.985, 1.0065), title="On a ring it seems unstable")
    for sign, style in ((1, "C0-"), (-1, "C3--")):
        sites, ahead, height = tables[f"run {sign:+d}"].values()
        grown.semilogy(sites[1:], np.abs(ahead[1:]), style)
        peak.plot(sites, height, style)
    sites, ahead, _ = tables["run +1"].values()
    start, count = np.interp(FIRST, sites, np.abs(ahead)), np.array([0.0, 2300.0, 4600.0])
    (rate,) = np.log(tables["mode"]["multiplier"])
    grown.semilogy(count, 30 * start * np.exp(rate * (count - FIRST)), "k:")
    grown.annotate("predicted slope", (1200, 200 * start), color="k", ha="right")
    grown.set(xlabel="sites passed", ylabel="ahead or behind [sites]")
    grown.set_title("A deviation grows as the multiplier says")
    peak.annotate("faster", (200, 0.77), color="C0")
    peak.annotate("spreads", (200, 0.60), color="C3")
    peak.set(xlabel="sites passed", ylabel="peak elongation [m]", title="and the wave changes")


def table(tables):
    wave, ring = "wave of r + r^7", float(tables["ring"]["modulus"].max())
    yield {wave: "stability changes", "speed": float(tables["change"]["speed"][0])}
    yield {wave: f"on a ring of {RING}", "speed": STABLE, "multiplier": ring}
    for words, sign in (("faster", 1), ("slower", -1)):
        run = tables[f"run {sign:+d}"]
        yield {wave: f"run, {words}", "speed": UNSTABLE, "multiplier": float(np.exp(growth(run))),
               "last peak": float(run["peak"][-1])}  # fmt: skip
    (factor,) = tables["mode"]["multiplier"]
    yield {wave: "predicted", "speed": UNSTABLE, "multiplier": float(factor)}
