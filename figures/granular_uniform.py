"""After an impact a chain of any material carries the exact wave of Hertz's law."""

import numpy as np

from figures import _guide
from granular import Bead, Striker, chain, hertz, materials, simulate
from tensegrity import PowerLaw, Record, State, first_peak, solitary_wave

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
    """Peak force, speed, momentum, energy of the wave in each chain; the exact wave."""
    found = [measured(name, v) for name, speeds in SCENES.items() for v in speeds]
    exact = solitary_wave(PowerLaw(1.0, HERTZ), mass=1.0, amplitude=-1.0)
    return {
        "waves": {key: np.array([f[key] for f in found]) for key in found[0]},
        "exact": {
            "constant": [exact.speed],
            "width": [exact.width(0.01)],
            "effective mass": [exact.momentum**2 / (2 * exact.energy)],
        },
    }


def measured(name, velocity):
    """The wave that a striker equal to the beads generates in a uniform chain."""
    one = Bead(_guide.STEEL.diameter, materials[name])
    alpha = hertz(one, one).constant
    scene = chain([one] * BEADS, striker=Striker(one, velocity))
    impact = (one.mass**2 / (alpha**2 * velocity)) ** 0.2
    t_end = (FAR[1] + 12) * 1.2 * impact
    run = simulate(
        scene, scene.start(), t_end, dt=FINE * impact, method="rkn6", record=Record(every=2)
    )
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
    }


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
    force = w["peak force [N]"] / (alpha**0.4 * m**0.6)
    return w["momentum [kg m/s]"] / m, force, w["speed [beads/s]"] * (m / alpha) ** 0.4


def table(tables):
    """The laws of the wave on a uniform chain."""
    exact, found, w = tables["exact"], constants(tables), tables["waves"]
    momentum, force, rate = scaled(tables)
    powers = [np.polyfit(np.log(momentum), np.log(y), 1)[0] for y in (force, rate)]
    mass = w["momentum [kg m/s]"] ** 2 / (2 * w["energy [J]"] * w["mass [kg]"])
    lines = {
        "constant c of V = 2 r c alpha^(1/3) m^(-1/2) F^(1/6)": f"{found[2]:.9f}",
        "the same of the exact travelling wave": f"{exact['constant'][0]:.9f}",
        "largest difference over materials and speeds": np.abs(
            found / exact["constant"][0] - 1
        ).max(),
        "power of momentum in the force, all chains": (f"{powers[0]:.6f}", "6/5"),
        "power of momentum in the speed, all chains": (f"{powers[1]:.6f}", "1/5"),
        "effective mass in beads": (f"{mass[2]:.6f}", 1.4),
        "that of the exact travelling wave": f"{exact['effective mass'][0]:.6f}",
        "width of the exact wave in beads, at 1 %": (exact["width"][0], "about 5"),
        "steel bead of 4.76 mm: mass by density [g]": (mass_by_density(_guide.STEEL), 0.45),
        "PTFE bead of 4.76 mm: mass by density [g]": (mass_by_density(_guide.PTFE), 0.123),
        "fraction of the energy in the wave": w["fraction of the energy"][2],
    }
    return _guide.rows("1D", lines)


def mass_by_density(one):
    """Mass of a bead of the paper by its diameter and the density of Table I [g]."""
    return 1e3 * Bead(one.diameter, one.material).mass


def draw(figure, tables):
    """Force and speed against momentum."""
    figure.set_size_inches(9, 4.2)
    momentum, force, rate = scaled(tables)
    names = list(tables["waves"]["material"])
    shown = {
        r"force / $(\alpha^{2/5} m^{3/5})$  [(m/s)$^{6/5}$]":
        (force, 6 / 5, 0.012, [0.02, 0.05, 0.1, 0.2, 0.4]),
        r"speed $(m/\alpha)^{2/5}$  [beads (m/s)$^{1/5}$]":
        (rate, 1 / 5, 0.44, [0.45, 0.5, 0.6, 0.7, 0.8]),
    }  # fmt: skip
    pairs = zip(figure.subplots(1, 2), shown.items(), strict=True)
    for axes, (label, (y, power, least, ticks)) in pairs:
        line = np.array([momentum.min(), momentum.max()])
        axes.loglog(line, y[0] * (line / momentum[0]) ** power, "k-", lw=0.8)
        axes.text(line[0], y.max(), f"line: power {power:g}", va="top")
        for x, top, name in zip(momentum, y, names, strict=True):
            colour = f"C{list(SCENES).index(name)}"
            axes.plot(x, top, "o", ms=5, color=colour)
            axes.annotate("PTFE" if name == "ptfe" else name, (x, top), (6, -4), color=colour,
                          textcoords="offset points", va="top", fontsize=9)  # fmt: skip
        axes.set(xlabel="momentum over mass [m/s]", ylabel=label, xlim=(0.04, 1.3))
        for axis, places in ((axes.xaxis, [0.05, 0.1, 0.2, 0.5, 1]), (axes.yaxis, ticks)):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("")
            axis.set_ticks(places)
        axes.set_ylim(least)
