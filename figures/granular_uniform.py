"""After an impact a chain of any material carries the exact wave of Hertz's law."""

from __future__ import annotations

import numpy as np

from derivations import contact
from figures._beads import bead
from figures._guide import PTFE, STEEL, row
from granular import Bead, Striker, chain, hertz, simulate
from tensegrity import PowerLaw, Record, State, first_peak, largest_peak, solitary_wave, width

NAME = "granular_uniform"
GROUP = "granular"

SCENES = {  # material: speeds of the striker [m/s]
    "steel": (0.05, 0.2, 0.585),
    "ptfe": (0.08, 0.45),
    "glass": (0.13, 0.35),
    "rubber": (0.27,),
}
FAR = (120, 200)  # contacts between which speeds are measured, well ahead of the debris
BEADS = 240
FINE = 1 / 30  # step over the time of an impact
HERTZ = 1.5


def data():
    """Peak force, speed, momentum, energy of the wave in each chain; shape and exact wave."""
    found = [measured(name, v) for name, speeds in SCENES.items() for v in speeds]
    exact = solitary_wave(PowerLaw(1.0, HERTZ), mass=1.0, amplitude=-1.0)
    x = np.linspace(-4, 4, 401)
    run, contact_number, rate = shape_run()
    shortening = run.scene.overlaps(run.u)[:, contact_number]
    instant, _ = first_peak(run.t, run.scene.contact_forces(run.u)[:, contact_number])
    inside = np.abs(run.t - instant) * rate < 4
    _, kappa, power = (e.subs(contact.exponent, HERTZ) for e in contact.nesterenko())
    compact = np.abs(x) < np.pi / 2 / float(kappa)
    long_wave = np.where(compact, np.cos(np.minimum(np.abs(x), 3) * float(kappa)), 0)
    _, top = largest_peak(run.t, shortening)
    return {
        "waves": {key: np.array([f[key] for f in found]) for key in found[0]},
        "shape": {
            "x [beads]": (run.t[inside] - instant) * rate,
            "overlap over peak": np.maximum(shortening[inside], 0) / top,
        },
        "theory": {
            "x [beads]": x,
            "exact": np.abs(exact.elongation(x)) / abs(exact.amplitude),
            "long wave": np.maximum(long_wave, 0) ** float(power),
        },
        "exact": {
            "constant": [exact.speed],
            "effective mass": [exact.momentum**2 / (2 * exact.energy)],
        },
    }


def measured(name, velocity):
    """The wave that a striker equal to the beads generates in a uniform chain."""
    one = bead(name)
    alpha = hertz(one, one).constant
    scene = chain([one] * BEADS, striker=Striker(one, velocity))
    impact = (one.mass**2 / (alpha**2 * velocity)) ** 0.2
    t_end = (FAR[1] + 12) * 1.2 * impact
    run = simulate(scene, scene.start(), t_end, dt=FINE * impact, method="rkn6",
                   record=Record(every=2))  # fmt: skip
    forces = scene.contact_forces(run.u)
    (first, _), (second, height) = (first_peak(run.t, forces[:, j]) for j in FAR)
    rate = (FAR[1] - FAR[0]) / (second - first)
    row_at = int(np.searchsorted(run.t, second))
    near = slice(FAR[1] - 12, None)
    momentum = float(scene.mass[near] @ run.v[row_at, near])
    energy = float(scene.site_energy(State(run.u[row_at], run.v[row_at]))[near].sum())
    return {
        "material": name,
        "striker [m/s]": velocity,
        "peak force [N]": height,
        "speed [beads/s]": rate,
        "momentum [kg m/s]": momentum,
        "energy [J]": energy,
        "mass [kg]": one.mass,
        "alpha [N/m^1.5]": alpha,
        "fraction of the energy": energy / run.energy[0],
        "energy error": run.energy_error,
    }


def shape_run():
    """The run whose wave is drawn, the contact at which it is read, and its speed."""
    one = bead("steel")
    scene = chain([one] * 160, striker=Striker(one, 0.585))
    run = simulate(scene, scene.start(), 1.3e-3, dt=0.4e-6, method="rkn6", record=Record(every=1))
    forces = scene.contact_forces(run.u)
    times = [first_peak(run.t, forces[:, j])[0] for j in (100, 140)]
    return run, 120, 40 / (times[1] - times[0])


def constants(tables):
    """c of V = c (F alpha^2)^(1/6) m^(-1/2), in beads per second, of each wave."""
    w = tables["waves"]
    force = w["peak force [N]"] ** (1 / 6) * w["alpha [N/m^1.5]"] ** (1 / 3)
    return w["speed [beads/s]"] * w["mass [kg]"] ** 0.5 / force


def scaled(tables):
    """Momentum, force and speed scaled by powers of alpha and m.

    In m/s, (m/s)^(6/5) and beads (m/s)^(1/5).
    """
    w = tables["waves"]
    alpha, m = w["alpha [N/m^1.5]"], w["mass [kg]"]
    momentum = w["momentum [kg m/s]"] / m
    return (
        momentum,
        w["peak force [N]"] / (alpha**0.4 * m**0.6),
        w["speed [beads/s]"] * ((m / alpha) ** 0.4),
    )


def table(tables):
    """The laws of the wave on a uniform chain."""
    exact, found, w = tables["exact"], constants(tables), tables["waves"]
    momentum, force, rate = scaled(tables)
    powers = [np.polyfit(np.log(momentum), np.log(y), 1)[0] for y in (force, rate)]
    mass = w["momentum [kg m/s]"] ** 2 / (2 * w["energy [J]"] * w["mass [kg]"])
    shape = tables["shape"]
    wide = width(shape["x [beads]"], shape["overlap over peak"], 0.01)
    name = "1D"
    return [
        row(name, "constant c of V = 2 r c alpha^(1/3) m^(-1/2) F^(1/6)", f"{found[2]:.9f}"),
        row(name, "the same of the exact travelling wave", f"{exact['constant'][0]:.9f}"),
        row(name, "largest difference over materials and speeds",
            float(np.max(np.abs(found / exact["constant"][0] - 1)))),
        row(name, "power of momentum in the force, all chains", f"{powers[0]:.6f}", "6/5"),
        row(name, "power of momentum in the speed, all chains", f"{powers[1]:.6f}", "1/5"),
        row(name, "effective mass in beads", f"{mass[2]:.6f}", 1.4),
        row(name, "the same of the exact travelling wave", f"{exact['effective mass'][0]:.6f}"),
        row(name, "width in beads, at 1 % of the compression", wide, "about 5"),
        row(name, "width of the long wave's solution in beads", _long_wave_width(), "about 5"),
        row(name, "steel bead of 4.76 mm: mass by density [g]", mass_by_density(STEEL), 0.45),
        row(name, "PTFE bead of 4.76 mm: mass by density [g]", mass_by_density(PTFE), 0.123),
        row(name, "fraction of the energy in the wave", float(w["fraction of the energy"][2])),
    ]  # fmt: skip


def mass_by_density(one):
    """Mass of a bead of the paper by its diameter and the density of Table I [g]."""
    return 1e3 * Bead(one.diameter, one.material).mass


def _long_wave_width():
    """Length of the hump of the long-wave solution, in beads."""
    kappa = contact.nesterenko()[1].subs(contact.exponent, HERTZ)
    return float(np.pi / kappa)


def draw(figure, tables):
    """Shape; speed against force; force and speed against momentum."""
    figure.set_size_inches(9, 3.9)
    shape_axes, *others = figure.subplots(1, 3)
    theory, shape = tables["theory"], tables["shape"]
    shape_axes.plot(theory["x [beads]"], theory["exact"], "C1")
    shape_axes.plot(theory["x [beads]"], theory["long wave"], "C2--")
    shape_axes.plot(shape["x [beads]"][::3], shape["overlap over peak"][::3], "C0.", ms=4)
    for text, place, colour in (
        ("exact\nwave", (1.05, 0.62), "C1"),
        ("in a chain", (1.5, 0.3), "C0"),
        ("long wave,\n$\\cos^4$", (-4.1, 0.2), "C2"),
    ):
        shape_axes.text(*place, text, color=colour)
    shape_axes.set(xlabel="distance from the peak [beads]", ylabel="compression over its peak")
    momentum, force, rate = scaled(tables)
    names = list(tables["waves"]["material"])
    for axes, y, power, label in (
        (others[0], force, 6 / 5, r"force / $(\alpha^{2/5} m^{3/5})$  [(m/s)$^{6/5}$]"),
        (others[1], rate, 1 / 5, r"speed $(m/\alpha)^{2/5}$  [beads (m/s)$^{1/5}$]"),
    ):
        line = np.array([momentum.min(), momentum.max()])
        axes.loglog(line, y[0] * (line / momentum[0]) ** power, "k-", lw=0.8)
        axes.text(line[0], y.max(), f"line: power {power:g}", va="top")
        for x, top, name in zip(momentum, y, names, strict=True):
            colour = f"C{list(SCENES).index(name)}"
            axes.plot(x, top, "o", ms=5, color=colour)
            axes.annotate("PTFE" if name == "ptfe" else name, (x, top), (6, -4), color=colour,
                          textcoords="offset points", va="top", fontsize=9)  # fmt: skip
        axes.set(xlabel="momentum over mass [m/s]", ylabel=label, xlim=(0.04, 1.3))
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("")
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1])
        axes.set_ylim(0.012 if power > 1 else 0.44)
        axes.set_yticks([0.02, 0.05, 0.1, 0.2, 0.4] if power > 1 else [0.45, 0.5, 0.6, 0.7, 0.8])
